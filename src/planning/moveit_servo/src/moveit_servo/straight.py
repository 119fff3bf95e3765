# SPDX-License-Identifier: BSD-3-Clause
"""Keeps a hand on the way of a twist that stays the same: what joints lag behind would add up to millimetres."""
from __future__ import annotations

import math

import numpy as np

from motion_planning.constraints.regions import rotation_vector
from moveit_servo.compiled import compiled
from urdf_model.transforms import axis_rotation

# Time in which the hand takes the direction of a new twist [s]; rate at which it then returns to its way [1/s], and the
# greatest share of the twist that this takes.
_SETTLED_S, _RETURN_RATE, _MAX_SHARE = 0.15, 14.0, 0.1
# A turn [rad] that counts as much as a shift [m] where one is weighed against the other.
_LEVER_M = 0.25


_rotation_vector, _axis_rotation = compiled(rotation_vector), compiled(axis_rotation)


class StraightWay:
    """The way that a hand would take under one twist, from where it had come up to speed; nothing else held it back."""

    def __init__(self) -> None:
        self._twist, self._settled_in, self._origin = np.zeros(6), _SETTLED_S, np.eye(4)

    def reset(self) -> None:
        """Another motion begins."""
        self._settled_in = _SETTLED_S

    def correction(self, pose: np.ndarray, twist: np.ndarray, seconds: float) -> np.ndarray:
        """Return the twist (6,) [m/s, rad/s] that leads ``pose`` (4, 4) back to the way, ``seconds`` after the last
        call; to be added to ``twist`` (6,). All in one frame."""
        if not np.array_equal(twist, self._twist):
            self._twist = twist.copy()
            self.reset()
        self._settled_in -= seconds
        if self._settled_in > 0.0:
            self._origin = pose
            return np.zeros(6)
        off, self._origin = _off_the_way(pose, self._origin, twist)
        size = math.sqrt(float(twist[:3] @ twist[:3]) + _LEVER_M**2 * float(twist[3:] @ twist[3:]))
        weighed = _RETURN_RATE * math.sqrt(float(off[:3] @ off[:3]) + _LEVER_M**2 * float(off[3:] @ off[3:]))
        return _RETURN_RATE * off * min(1.0, _MAX_SHARE * size / max(weighed, 1e-12))


@compiled
def _off_the_way(pose, origin, twist):
    """Return (off (6,), next origin (4, 4)): shift [m] and turn [rad] from ``pose`` (4, 4) to the way that leads from
    ``origin`` along ``twist`` (6,). The origin moves along, so that a turn by more than half a circle is none the other
    way round."""
    before, here = np.ascontiguousarray(origin[:3, :3]), np.ascontiguousarray(pose[:3, :3])
    turn = _rotation_vector(here @ before.T)
    along, square, speed = 0.0, 0.0, math.sqrt(twist[3] ** 2 + twist[4] ** 2 + twist[5] ** 2)
    for a in range(3):
        v, w = twist[a], _LEVER_M**2 * twist[3 + a]
        along += v * (pose[a, 3] - origin[a, 3]) + w * turn[a]
        square += v * v + w * twist[3 + a]
    gone = along / square
    turned = before
    if speed > 0.0:
        turned = _axis_rotation((twist[3] / speed, twist[4] / speed, twist[5] / speed), speed * gone) @ before
    off, after = np.empty(6), np.eye(4)
    off[3:] = _rotation_vector(turned @ here.T)
    for a in range(3):
        off[a] = gone * twist[a] - (pose[a, 3] - origin[a, 3])
        after[a, 3] = pose[a, 3] + off[a]
    after[:3, :3] = turned
    return off, after
