# SPDX-License-Identifier: BSD-3-Clause
"""The ideal camera. ROS-free.

Its frame is the optical one of REP-103: z ahead, x right, y down. The centre of the top left pixel is (0, 0), so the
picture spans -0.5 to width - 0.5, as ``sensor_msgs/CameraInfo`` and OpenCV count.
"""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from sensor_renderer.errors import SensorError

#: Larger pictures are refused: 4096 x 4096 takes a minute in software, and 16 bytes a point make 256 MB of a cloud.
MAX_PIXELS = 4096
_WIDEST_RAD = math.radians(170.0)

#: Rotation of the optical frame in a frame whose x looks ahead and whose z is up.
OPTICAL = np.array([[0.0, 0.0, 1.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]])


class Pinhole(NamedTuple):
    """Size [pixels], focal lengths and principal point [pixels], nearest and furthest visible depth [m]."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    near: float
    far: float

    @classmethod
    def from_field_of_view(cls, width: int, height: int, horizontal_rad: float, near: float, far: float) -> Pinhole:
        """A camera with square pixels that looks through the middle of its picture.

        Raises :class:`SensorError` for impossible values.
        """
        if not (1 <= width <= MAX_PIXELS and 1 <= height <= MAX_PIXELS):
            raise SensorError("a picture of %d x %d pixels is out of range; expected 1 to %d each"
                              % (width, height, MAX_PIXELS))
        if not 0.0 < horizontal_rad <= _WIDEST_RAD:
            raise SensorError("a horizontal field of view of %g rad is out of range; expected more than 0, at most %.3f"
                              % (horizontal_rad, _WIDEST_RAD))
        if not 0.0 < near < far < math.inf:
            raise SensorError("clip distances of %g and %g m are of no use; expected 0 < near < far" % (near, far))
        focal = width / 2.0 / math.tan(horizontal_rad / 2.0)
        return cls(int(width), int(height), focal, focal, (width - 1) / 2.0, (height - 1) / 2.0, float(near),
                   float(far))

    @property
    def blind_m(self) -> float:
        """How far from the eye something may be and yet be too near to be seen [m]: to the corners of the rectangle at
        the nearest depth."""
        x = max(self.cx + 0.5, self.width - 0.5 - self.cx) / self.fx
        y = max(self.cy + 0.5, self.height - 0.5 - self.cy) / self.fy
        return self.near * math.sqrt(1.0 + x * x + y * y)

    def project(self, points: npt.ArrayLike) -> np.ndarray:
        """Pixel coordinates (n, 2) of points (n, 3) [m] in the optical frame."""
        points = np.asarray(points, dtype=float)
        return np.stack([self.fx * points[:, 0] / points[:, 2] + self.cx,
                         self.fy * points[:, 1] / points[:, 2] + self.cy], axis=1)

    def clip_matrix(self) -> np.ndarray:
        """The (4, 4) matrix from the optical frame to OpenGL's clip space, the picture's first row at the bottom.

        OpenGL fills memory from the bottom row, so the memory then holds the picture from its top row.
        """
        near, far = self.near, self.far
        return np.array([
            [2.0 * self.fx / self.width, 0.0, (2.0 * self.cx + 1.0) / self.width - 1.0, 0.0],
            [0.0, 2.0 * self.fy / self.height, (2.0 * self.cy + 1.0) / self.height - 1.0, 0.0],
            [0.0, 0.0, (far + near) / (far - near), -2.0 * far * near / (far - near)],
            [0.0, 0.0, 1.0, 0.0]])

    def depth_from_buffer(self, values: np.ndarray) -> np.ndarray:
        """Distance along z [m] of depth buffer ``values`` (float32, 0 to 1); NaN where nothing was drawn."""
        near, far = np.float32(self.near), np.float32(self.far)
        with np.errstate(divide="ignore"):
            depth = (near * far) / (far - values * (far - near))
        depth[values >= 1.0] = np.nan
        return depth
