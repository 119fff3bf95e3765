# SPDX-License-Identifier: BSD-3-Clause
"""RAW_POSITION: a stream of set-points is followed at its own rate."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .joint_modes import RAW_POSITION

if TYPE_CHECKING:
    from .joint_command import JointCommand, JointLimits
    from .setpoint import SetPoints

STREAM_GAP_S = 0.05  # raw commands that follow each other within this are one stream
FEED_FORWARD_S = 0.05  # time that a feed-forward velocity belongs to the raw commands that come in


class RawStream:
    """The times of the last raw set-points, and their velocities, for n joints.

    limits: JointLimits; speed: (n,) [rad/s] how fast set-points may go; dt: length of a tick [s].
    """

    def __init__(self, limits: JointLimits, speed: np.ndarray, dt: float) -> None:
        self._limits, self._speed, self._dt = limits, speed, dt
        count = len(limits.names)
        # Of the newest command, and of the newest one at an earlier time.
        self._stamp, self._earlier = np.full(count, -np.inf), np.full(count, -np.inf)
        self._velocity = np.zeros(count)  # [rad/s]
        self._velocity_stamp = np.full(count, -np.inf)

    def reset(self) -> None:
        """Forget all set-points: after a reset of the clock they would seem recent."""
        self._stamp[:] = self._earlier[:] = self._velocity_stamp[:] = -np.inf

    def feed_forward(self, index: np.ndarray, velocities: np.ndarray, time_s: float) -> None:
        """At time_s [s] the set-points of joints `index` move at velocities [rad/s], clipped to the bounds."""
        limit = self._speed[index]
        self._velocity[index] = np.clip(velocities, -limit, limit)
        self._velocity_stamp[index] = time_s

    def said_velocity(self, time_s: float) -> np.ndarray:
        """(n,) [rad/s] at what the set-points are said to move at time_s [s]; 0 for those of which nobody says so."""
        return np.where(time_s - self._velocity_stamp <= FEED_FORWARD_S, self._velocity, 0.0)

    def take(self, points: SetPoints, mode: np.ndarray, command: JointCommand, time_s: float) -> None:
        """Take a raw command at time_s [s]: its target moves there at the stream's own pace, or jumps there if no
        stream runs. points: SetPoints; mode: (n,) of the joints, before the command; command: JointCommand."""
        index = command.index
        # Commands that come between the same two ticks count as one, or the last would have only a tick for its way.
        stamp = self._stamp[index]
        earlier = np.where(stamp == time_s, self._earlier[index], stamp)
        gap = np.maximum(time_s - earlier, self._dt)
        goes_on = (mode[index] == RAW_POSITION) & (gap <= STREAM_GAP_S)
        points.target[index] = np.where(goes_on, points.target[index], command.values)
        limit = self._speed[index]
        # With a feed-forward velocity, the goal is the predicted next command.
        is_fresh = goes_on & (time_s - self._velocity_stamp[index] <= FEED_FORWARD_S)
        ahead = np.where(is_fresh, self._velocity[index] * np.minimum(gap, STREAM_GAP_S), 0.0)
        goal = np.clip(command.values + ahead, self._limits.lower[index], self._limits.upper[index])
        points.pace[index] = np.clip((goal - points.target[index]) / gap, -limit, limit)
        points.goal[index] = goal
        self._stamp[index], self._earlier[index] = time_s, earlier
