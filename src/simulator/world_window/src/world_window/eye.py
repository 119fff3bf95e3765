# SPDX-License-Identifier: BSD-3-Clause
"""The viewer's eye: its place, and how it orbits, pans and zooms. ROS-free."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from sensor_renderer.pinhole import Pinhole

# Steeper looks would turn the picture over [rad].
_STEEPEST_RAD = math.radians(89.5)
# An eye never comes nearer than this to the point that it zooms to, nor gets farther from the origin [m].
NEAREST_M, FARTHEST_M = 0.08, 1000.0


class Eye(NamedTuple):
    """``position`` [m, world]; ``yaw``: the direction of view about the vertical, 0 along x; ``pitch``: how far it
    looks up [rad]. The horizon is level."""

    position: tuple[float, float, float]
    yaw: float
    pitch: float

    @classmethod
    def looking_at(cls, position: Sequence[float] | np.ndarray, target: Sequence[float] | np.ndarray) -> Eye:
        """An eye at ``position`` (3,) with ``target`` (3,) [m] in its middle."""
        x, y, z = np.subtract(target, position)
        place = (float(position[0]), float(position[1]), float(position[2]))
        return cls(place, math.atan2(y, x), _not_steeper(math.atan2(z, math.hypot(x, y))))

    def rotation(self) -> np.ndarray:
        """(3, 3): columns right, down and ahead, in the world: the optical frame of REP-103."""
        ahead = np.array([math.cos(self.pitch) * math.cos(self.yaw), math.cos(self.pitch) * math.sin(self.yaw),
                          math.sin(self.pitch)])
        right = np.array([math.sin(self.yaw), -math.cos(self.yaw), 0.0])
        return np.stack([right, np.cross(ahead, right), ahead], axis=1)

    def pose(self) -> np.ndarray:
        """Pose (4, 4) of the optical frame in the world."""
        pose = np.eye(4)
        pose[:3, :3] = self.rotation()
        pose[:3, 3] = self.position
        return pose

    def orbited(self, about: Sequence[float] | np.ndarray, left_rad: float, up_rad: float) -> Eye:
        """Moved on a sphere about the point ``about`` (3,), which stays where it is in the picture."""
        turned = self._replace(yaw=self.yaw + left_rad, pitch=_not_steeper(self.pitch + up_rad))
        in_view = self.rotation().T @ np.subtract(about, self.position)
        return turned.at(np.asarray(about) - turned.rotation() @ in_view)

    def panned(self, right_px: float, down_px: float, pinhole: Pinhole, depth_m: float) -> Eye:
        """Moved sideways so that what is ``depth_m`` ahead moves by these pixels in the picture."""
        right, down, _ = self.rotation().T
        return self.at(np.asarray(self.position) - right * (right_px * depth_m / pinhole.fx)
                       - down * (down_px * depth_m / pinhole.fy))

    def zoomed(self, towards: Sequence[float] | np.ndarray, factor: float) -> Eye:
        """Moved to ``factor`` times its distance from the point ``towards`` (3,)."""
        towards = np.asarray(towards, dtype=float)
        away = np.asarray(self.position) - towards
        distance = max(float(np.linalg.norm(away)), 1e-9)
        return self.at(towards + away * max(factor, min(1.0, NEAREST_M / distance)))

    def at(self, position: Sequence[float] | np.ndarray) -> Eye:
        """The same look from another ``position`` (3,)."""
        position = np.asarray(position, dtype=float)
        distance = np.linalg.norm(position)
        return self._replace(position=tuple((position * min(1.0, FARTHEST_M / max(distance, 1e-9))).tolist()))


def _not_steeper(pitch):
    return min(max(pitch, -_STEEPEST_RAD), _STEEPEST_RAD)
