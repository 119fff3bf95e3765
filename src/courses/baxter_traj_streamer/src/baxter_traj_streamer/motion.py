# SPDX-License-Identifier: BSD-3-Clause
"""The execution of one plan: joint positions over time, and an early stop. Free of ROS."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from baxter_traj_streamer.judging import AcceptedPlan

# Number of samples in the search for the highest velocity of the rest of the path.
_PLACES = 200


class StreamedMotion:
    """A :class:`~.judging.AcceptedPlan` from ``start_time`` [s] on.

    A stop stays on the checked path: the time along it slows down evenly to zero. The deceleration is then
    at most ``stop_deceleration`` [rad/s^2] more than the trajectory's own acceleration.
    """

    def __init__(self, plan: AcceptedPlan, start_time: float, stop_deceleration: float) -> None:
        self.plan = plan
        self._start_time = start_time
        self._stop_deceleration = stop_deceleration
        # Infinity: nothing stops it.
        self._stop_time = math.inf
        self._stop_duration_s = 0.0

    def positions(self, time_s: float) -> np.ndarray:
        """(k,) [rad] at ``time_s``."""
        return self.plan.trajectory.sample(self._way_time(time_s))[0]

    def stop(self, time_s: float) -> None:
        """Come to rest from ``time_s`` on, which must not be before the last queried time."""
        if self.stopping:
            return
        here = self._way_time(time_s)
        rest = np.linspace(here, max(here, self.plan.duration_s), _PLACES)
        fastest = max(float(np.abs(self.plan.trajectory.sample(t)[1]).max()) for t in rest)
        self._stop_duration_s = fastest / self._stop_deceleration
        self._stop_time = time_s

    @property
    def stopping(self) -> bool:
        """Whether :meth:`stop` was called."""
        return self._stop_time < math.inf

    def is_at_rest(self, time_s: float) -> bool:
        """Whether the motion is over: at its end, or after a stop."""
        return time_s >= self._stop_time + self._stop_duration_s or self._way_time(time_s) >= self.plan.duration_s

    def percent(self, time_s: float) -> int:
        """Share of the path's time that has passed, 0 to 100."""
        # A goal at the robot's position has the duration zero.
        share = self._way_time(time_s) / self.plan.duration_s if self.plan.duration_s > 0.0 else 1.0
        return int(math.floor(100.0 * min(1.0, share)))

    def _way_time(self, time_s: float) -> float:
        """Time along the path [s], not below 0."""
        if not self.stopping:
            return max(0.0, time_s - self._start_time)
        since = min(time_s - self._stop_time, self._stop_duration_s)
        here = max(0.0, self._stop_time - self._start_time)
        if self._stop_duration_s <= 0.0:
            return here
        return here + since - since * since / (2.0 * self._stop_duration_s)
