# SPDX-License-Identifier: BSD-3-Clause
"""Keeps a hand on the way of a twist that stays the same: what joints lag behind would add up to millimetres."""
from __future__ import annotations

import math

import numpy as np

from motion_planning.constraints.regions import rotation_vector
from urdf_model.transforms import axis_rotation

# Time in which the hand takes the direction of a new twist [s]; rate at which it then returns to its way [1/s], and the
# greatest share of the twist that this takes.
_SETTLED_S, _RETURN_RATE, _MAX_SHARE = 0.15, 6.0, 0.1
# A turn [rad] that counts as much as a shift [m] where one is weighed against the other.
_LEVER_M = 0.25


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
        shift = pose[:3, 3] - self._origin[:3, 3]
        along = np.concatenate([twist[:3], _LEVER_M * twist[3:]])
        turn = rotation_vector(pose[:3, :3] @ self._origin[:3, :3].T)
        size = float(along @ along)
        gone = float(along @ np.concatenate([shift, _LEVER_M * turn])) / size
        speed = float(np.linalg.norm(twist[3:]))
        turned = self._origin[:3, :3]
        if speed:
            turned = axis_rotation(twist[3:] / speed, speed * gone) @ turned
        off = np.concatenate([gone * twist[:3] - shift, rotation_vector(turned @ pose[:3, :3].T)])
        # The origin moves along, so that a turn by more than half a circle is none the other way round.
        self._origin = np.eye(4)
        self._origin[:3, :3], self._origin[:3, 3] = turned, pose[:3, 3] + off[:3]
        weighed = _RETURN_RATE * math.sqrt(float(off[:3] @ off[:3]) + _LEVER_M**2 * float(off[3:] @ off[3:]))
        return _RETURN_RATE * off * min(1.0, _MAX_SHARE * math.sqrt(size) / max(weighed, 1e-12))
