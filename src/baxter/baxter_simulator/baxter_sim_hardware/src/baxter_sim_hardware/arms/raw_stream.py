# SPDX-License-Identifier: BSD-3-Clause
"""RAW_POSITION: a stream of set-points is followed at its own rate."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from disk_cache.compiled import compiler

from .joint_modes import RAW_POSITION

if TYPE_CHECKING:
    from .joint_command import ArmLimits, CheckedCommand
    from .setpoint import SetPoints

STREAM_GAP_S = 0.05  # raw commands that follow each other within this are one stream
FEED_FORWARD_S = 0.05  # time that a feed-forward velocity belongs to the raw commands that come in

_compiled = compiler("baxter_sim_hardware", [__file__], error_model="numpy")


@_compiled
def _take(numbers: np.ndarray, points: np.ndarray, bounds: np.ndarray, mode: np.ndarray, index: np.ndarray,
          values: np.ndarray, time: tuple[float, float]) -> None:
    """`RawStream.take`. numbers: of the stream, (4, n); points: of `SetPoints`; bounds: (3, n) lower, upper, speed;
    values: (k,) of the joints `index`; time: now and length of a tick [s]."""
    time_s, dt = time
    stamp, earlier, velocity, velocity_stamp = numbers[0], numbers[1], numbers[2], numbers[3]
    target, goal, pace = points[2], points[6], points[7]
    for i, joint in enumerate(index):
        # Commands that come between the same two ticks count as one, or the last would have only a tick for its way.
        if stamp[joint] != time_s:
            earlier[joint] = stamp[joint]
        stamp[joint] = time_s
        gap = max(time_s - earlier[joint], dt)
        wanted, least, most, limit = values[i], bounds[0, joint], bounds[1, joint], bounds[2, joint]
        if mode[joint] != RAW_POSITION or gap > STREAM_GAP_S:
            target[joint] = wanted
        elif time_s - velocity_stamp[joint] <= FEED_FORWARD_S:
            # With a feed-forward velocity, the goal is the predicted next command.
            wanted += velocity[joint] * min(gap, STREAM_GAP_S)
        goal[joint] = min(max(wanted, least), most)
        pace[joint] = min(max((goal[joint] - target[joint]) / gap, -limit), limit)


class RawStream:
    """The times of the last raw set-points, and their velocities, for n joints.

    limits: ArmLimits; speed: (n,) [rad/s] how fast set-points may go; dt: length of a tick [s].
    """

    def __init__(self, limits: ArmLimits, speed: np.ndarray, dt: float) -> None:
        self._bounds, self._dt = np.array([limits.lower, limits.upper, speed]), dt
        self._speed = self._bounds[2]
        # All are views of one array, which a compiled function takes sooner.
        self._numbers = np.full((4, len(limits.names)), -np.inf)
        # Of the newest command, and of the newest one at an earlier time; [rad/s].
        self._stamp, self._earlier, self._velocity, self._velocity_stamp = self._numbers
        self._velocity[:] = 0.0

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

    def take(self, points: SetPoints, mode: np.ndarray, command: CheckedCommand, time_s: float) -> None:
        """Take a raw command at time_s [s]: its target moves there at the stream's own pace, or jumps there if no
        stream runs. points: SetPoints; mode: (n,) of the joints, before the command; command: CheckedCommand."""
        _take(self._numbers, points.numbers, self._bounds, mode, command.index, command.values,
              (time_s, self._dt))
