# SPDX-License-Identifier: BSD-3-Clause
"""Clouds of points and depth images as arrays, and back."""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from sensor_msgs.msg import PointCloud2, PointField

from moveit_ros_move_group.convert.geometry import MessageError

if TYPE_CHECKING:
    from sensor_msgs.msg import CameraInfo, Image
    from std_msgs.msg import Header


def points_of(message: PointCloud2) -> np.ndarray:
    """Return the points (n, 3), float32, of a PointCloud2, row after row. Raises MessageError."""
    fields = {field.name: field for field in message.fields}
    missing = [name for name in "xyz" if name not in fields or fields[name].datatype != PointField.FLOAT32]
    if missing:
        raise MessageError("the cloud has no field '%s' of type FLOAT32" % missing[0])
    rows, columns, step = message.height, message.width, message.point_step
    if any(fields[name].offset + 4 > step for name in "xyz") or message.row_step < columns * step or \
            len(message.data) < rows * message.row_step:
        raise MessageError("the cloud's sizes do not fit: %d rows of %d points of %d bytes, %d bytes a row, %d bytes "
                           "in all" % (rows, columns, step, message.row_step, len(message.data)))
    if not rows * columns:
        return np.empty((0, 3), np.float32)
    kind = np.dtype(">f4" if message.is_bigendian else "<f4")
    parts = [np.ndarray((rows, columns), kind, message.data, fields[name].offset, (message.row_step, step)).ravel()
             for name in "xyz"]
    return np.stack(parts, axis=1).astype(np.float32, copy=False)


def points_of_depth(image: Image, info: CameraInfo, near: float, far: float) -> np.ndarray:
    """Return the points (n, 3), float32, of a depth Image (32FC1 [m] or 16UC1 [mm]) and its CameraInfo.

    NaN where the depth [m] is not between ``near`` and ``far``. Raises MessageError.
    """
    kinds = {"32FC1": ("f4", 1.0), "16UC1": ("u2", 1e-3), "mono16": ("u2", 1e-3)}
    if image.encoding not in kinds:
        raise MessageError("the depth image is %s; expected 32FC1 or 16UC1" % image.encoding)
    kind, unit = kinds[image.encoding]
    kind = np.dtype((">" if image.is_bigendian else "<") + kind)
    if image.step < image.width * kind.itemsize or len(image.data) < image.height * image.step:
        raise MessageError("the depth image's sizes do not fit: %d x %d pixels, %d bytes a row, %d bytes in all"
                           % (image.width, image.height, image.step, len(image.data)))
    fx, cx, fy, cy = info.K[0], info.K[2], info.K[4], info.K[5]
    if not (fx > 0.0 and fy > 0.0):
        raise MessageError("the camera_info of the depth image has focal lengths %g and %g" % (fx, fy))
    depth = np.ndarray((image.height, image.width), kind, image.data, 0, (image.step, kind.itemsize)) * np.float32(unit)
    with np.errstate(invalid="ignore"):
        depth = np.where((depth >= near) & (depth <= far), depth, np.nan)
    across = (np.arange(image.width) - cx) / fx
    down = (np.arange(image.height) - cy) / fy
    return np.stack([depth * across, depth * down[:, None], depth], axis=-1).reshape(-1, 3).astype(np.float32)


def cloud_of(points: np.ndarray, header: Header) -> PointCloud2:
    """Return the PointCloud2 of points (n, 3)."""
    names = [PointField(name, 4 * i, PointField.FLOAT32, 1) for i, name in enumerate("xyz")]
    data = np.ascontiguousarray(points, dtype="<f4").tobytes()
    return PointCloud2(header, 1, len(points), names, False, 12, 12 * len(points), data, True)
