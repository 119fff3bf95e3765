# SPDX-License-Identifier: BSD-3-Clause
"""Clouds of points for a browser: few enough to draw, as bytes. No ROS: messages are objects with the fields of
sensor_msgs/PointCloud2.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from typing import Any

    from sensor_msgs.msg import PointCloud2

#: Points of one cloud that a page gets.
MAX_POINTS = 20000
#: The first number of a frame with points; poses of the scene have their revision there [uint32].
MARK = 0xFFFFFFFF
# Of sensor_msgs/PointField.
_FLOATS = {7: "f4", 8: "f8"}
_COLOURS = ("rgb", "rgba")
_GREY = 150


class CloudError(Exception):
    """A message that is no cloud with x, y and z; the text says why."""


def points_of(message: PointCloud2, most: int = MAX_POINTS) -> tuple[np.ndarray, np.ndarray]:
    """(points [m], float32 (n, 3); colours, uint8 (n, 3) red first) of a PointCloud2: every k-th row and column, so
    that at most ``most`` remain, without those that were not measured. Raises CloudError.
    """
    fields = {field.name: field for field in message.fields or ()}
    missing = [name for name in "xyz" if name not in fields or fields[name].datatype not in _FLOATS]
    if missing:
        raise CloudError("it has no %s as floats; its fields are %s"
                         % (", ".join(missing), ", ".join(fields) or "none"))
    wide, high, step = message.width, message.height, message.point_step
    row_step = message.row_step or wide * step
    ends = [fields[name].offset + np.dtype(_FLOATS[fields[name].datatype]).itemsize for name in "xyz"]
    if row_step < wide * step or len(message.data) < high * row_step or max(ends) > step:
        raise CloudError("%d bytes are no %d x %d points of %d bytes" % (len(message.data), wide, high, step))
    if not wide * high:
        return np.empty((0, 3), np.float32), np.empty((0, 3), np.uint8)
    # One row is thinned along itself, an image in both directions.
    skip = math.ceil(wide * high / most) if high == 1 else math.ceil(math.sqrt(wide * high / most))
    rows = np.frombuffer(message.data, np.uint8, high * row_step).reshape(high, row_step)[:: skip if high > 1 else 1]
    cells = np.ascontiguousarray(rows[:, : wide * step].reshape(len(rows), wide, step)[:, ::skip]).reshape(-1, step)
    order = ">" if message.is_bigendian else "<"
    points = np.column_stack([_column(cells, fields[name].offset, order + _FLOATS[fields[name].datatype])
                              for name in "xyz"]).astype(np.float32)
    measured = np.isfinite(points).all(axis=1)
    return points[measured], _colours(cells, fields, message.is_bigendian)[measured]


def _column(cells: np.ndarray, offset: int, kind: str) -> np.ndarray:
    size = np.dtype(kind).itemsize
    return np.ascontiguousarray(cells[:, offset:offset + size]).view(kind)[:, 0]


def _colours(cells: np.ndarray, fields: dict[str, Any], is_bigendian: bool) -> np.ndarray:
    field = next((fields[name] for name in _COLOURS if name in fields), None)
    if field is None or field.offset + 4 > cells.shape[1]:
        return np.full((len(cells), 3), _GREY, np.uint8)
    # 0x00RRGGBB.
    at = [1, 2, 3] if is_bigendian else [2, 1, 0]
    return cells[:, [field.offset + place for place in at]]


def packed(points: np.ndarray, colours: np.ndarray, pose: np.ndarray) -> bytes:
    """Bytes for a page: MARK and the number of points [uint32], the upper three rows of ``pose`` (the cloud's frame in
    the scene, 4 x 4) and the points [float32], the colours [uint8].
    """
    return (np.array([MARK, len(points)], "<u4").tobytes() + np.asarray(pose)[:3].astype("<f4").tobytes()
            + points.astype("<f4").tobytes() + colours.tobytes())
