# SPDX-License-Identifier: BSD-3-Clause
"""Simulated and real time as the window shows them. ROS-free; wall times are arguments."""
from __future__ import annotations

import collections

#: The real-time factor is measured over this long [s, wall].
SPAN_S = 1.0


class Clock:
    """``simulated_s``: simulation time; ``paused``; ``factor``: the real-time factor of the last second, None while
    there is none."""

    def __init__(self) -> None:
        self.simulated_s, self.paused, self.factor = 0.0, False, None
        self._samples = collections.deque()

    def take(self, simulated_s: float, paused: bool, wall_s: float) -> None:
        """A state of the world was read at ``wall_s`` [s]."""
        if paused or simulated_s < self.simulated_s:
            self._samples.clear()  # a pause does not count as slow, and a reset starts again
            self.factor = None
        self.simulated_s, self.paused = simulated_s, paused
        if paused:
            return
        samples = self._samples
        samples.append((wall_s, simulated_s))
        while len(samples) > 2 and wall_s - samples[1][0] >= SPAN_S:
            samples.popleft()
        elapsed = wall_s - samples[0][0]
        if elapsed >= 0.5 * SPAN_S:
            self.factor = (simulated_s - samples[0][1]) / elapsed
