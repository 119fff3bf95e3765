# SPDX-License-Identifier: BSD-3-Clause
"""From pictures to messages."""
from __future__ import annotations

import sys
from collections.abc import Iterable
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, PointCloud2, PointField

from sensor_renderer.pictures import Cloud, encoded
from sim_time.stamps import stamp

if TYPE_CHECKING:
    from sensor_renderer.pinhole import Pinhole

Stamped = TypeVar("Stamped", CameraInfo, CompressedImage, Image, PointCloud2)
_BIG_ENDIAN = sys.byteorder == "big"
#: image_transport's own default.
JPEG_QUALITY = 80


def header(message: Stamped, time_s: float, frame: str) -> Stamped:
    """``message`` with its header filled: simulation time [s] and frame."""
    message.header.stamp = stamp(time_s)
    message.header.frame_id = frame
    return message


def image(picture: np.ndarray, encoding: str) -> Image:
    """sensor_msgs/Image of a colour picture (height, width, 3)."""
    data, step = encoded(picture, encoding)
    return Image(height=picture.shape[0], width=picture.shape[1], encoding=encoding, is_bigendian=0, step=step,
                 data=data)


def values_image(values: np.ndarray) -> Image:
    """sensor_msgs/Image of one number a pixel, (height, width): uint8 (mono8), uint16 (mono16), float32 (32FC1); or of
    two, (height, width, 2) of float32 (32FC2)."""
    height, width = values.shape[:2]
    encoding = "32FC2" if values.ndim == 3 else {1: "mono8", 2: "mono16", 4: "32FC1"}[values.dtype.itemsize]
    data = np.ascontiguousarray(values).tobytes()
    return Image(height=height, width=width, encoding=encoding, is_bigendian=_BIG_ENDIAN, step=len(data) // height,
                 data=data)


def depth_image(values: np.ndarray) -> Image:
    """sensor_msgs/Image of float32 metres or uint16 millimetres (height, width)."""
    message = values_image(values)
    if message.encoding == "mono16":
        message.encoding = "16UC1"
    return message


def compressed_image(picture: np.ndarray, quality: int = JPEG_QUALITY) -> CompressedImage:
    """sensor_msgs/CompressedImage, JPEG of ``quality`` (1 to 100), of a colour picture (height, width, 3)."""
    import cv2

    blue_first = cv2.cvtColor(np.ascontiguousarray(picture), cv2.COLOR_RGB2BGR)
    _, data = cv2.imencode(".jpg", blue_first, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return CompressedImage(format="rgb8; jpeg compressed bgr8", data=data.tobytes())


def camera_info(pinhole: Pinhole, baseline_m: float = 0.0, distortion: Iterable[float] = (0.0,) * 5) -> CameraInfo:
    """sensor_msgs/CameraInfo; ``baseline_m`` as stereo's second camera has it; ``distortion``: k1, k2, p1, p2, k3."""
    fx, fy, cx, cy = pinhole.fx, pinhole.fy, pinhole.cx, pinhole.cy
    return CameraInfo(
        height=pinhole.height, width=pinhole.width, distortion_model="plumb_bob", D=list(distortion),
        K=[fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0], R=[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        P=[fx, 0.0, cx, -fx * baseline_m, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0])


def point_cloud(points: np.ndarray) -> PointCloud2:
    """sensor_msgs/PointCloud2 of :meth:`Cloud.points`."""
    height, width = points.shape[:2]
    fields = [PointField(name, 4 * number, PointField.FLOAT32, 1) for number, name in enumerate(("x", "y", "z", "rgb"))]
    return PointCloud2(height=height, width=width, fields=fields, is_bigendian=_BIG_ENDIAN,
                       point_step=Cloud.POINT_BYTES, row_step=width * Cloud.POINT_BYTES, data=points.tobytes(),
                       is_dense=False)
