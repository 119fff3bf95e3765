# SPDX-License-Identifier: BSD-3-Clause
"""From a pose that the hand should have to the twist that leads there: MoveIt's four PID controllers."""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from motion_planning.constraints.regions import rotation_vector

if TYPE_CHECKING:
    from moveit_servo.settings import ServoSettings


class PoseTracker:
    """One controller for each axis of the position, one for the angle of the rotation that is left."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget sums and the last error: a new motion begins."""
        self._sum, self._last = np.zeros(4), None

    def twist(self, pose: np.ndarray, target: np.ndarray, settings: ServoSettings, seconds: float) -> np.ndarray:
        """Return the twist (6,) [m/s, rad/s] from ``pose`` (4, 4) to ``target`` (4, 4), both in one frame, which is
        also the twist's."""
        turn = rotation_vector(target[:3, :3] @ pose[:3, :3].T)
        angle = float(np.linalg.norm(turn))
        error = np.array([*(target[:3, 3] - pose[:3, 3]), angle])
        axes = ("x", "y", "z", "angular")
        gains = [np.array([getattr(settings, "%s_%s_gain" % (axis, kind)) for axis in axes])
                 for kind in ("proportional", "integral", "derivative")]
        self._sum = np.clip(self._sum + error * seconds, -settings.windup_limit, settings.windup_limit)
        change = np.zeros(4) if self._last is None or seconds <= 0.0 else (error - self._last) / seconds
        self._last = error
        command = gains[0] * error + gains[1] * self._sum + gains[2] * change
        return np.concatenate([command[:3], command[3] * turn / angle if angle > 1e-9 else np.zeros(3)])
