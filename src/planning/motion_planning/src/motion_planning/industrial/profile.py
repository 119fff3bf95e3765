# SPDX-License-Identifier: BSD-3-Clause
"""A motion from 0 to 1 in time: full acceleration, full speed, full deceleration."""
from __future__ import annotations

import math

import numpy as np

# The mean over this time [s] makes the trapezoid's acceleration continuous, as interpolating controllers need.
WINDOW_S = 0.1


class Profile:
    """A velocity trapezoid over a path of length 1, smoothed by a moving mean. The mean respects the limits.

    duration [s]; speeding_up, slowing_down [s]: durations of acceleration and deceleration.
    """

    def __init__(self, velocity: float, acceleration: float, deceleration: float) -> None:
        """The greatest values, above 0 [1/s, 1/s^2]."""
        top = min(velocity, math.sqrt(2.0 * acceleration * deceleration / (acceleration + deceleration)))
        up, down = top / acceleration, top / deceleration
        cruise = max(0.0, (1.0 - 0.5 * top * (up + down)) / top)
        self.duration = up + cruise + down + WINDOW_S
        self.speeding_up, self.slowing_down = up + WINDOW_S, down + WINDOW_S
        self._begins = np.array([0.0, up, up + cruise, up + cruise + down])
        # Position, speed and acceleration at the start of each section; the last one is the rest at the end.
        self._ways = np.array([0.0, 0.5 * top * up, 0.5 * top * up + top * cruise, 1.0])
        self._speeds = np.array([0.0, top, top, 0.0])
        self._rates = np.array([acceleration, 0.0, -deceleration, 0.0])
        lengths = np.diff(self._begins)
        areas = lengths * (self._ways[:3] + lengths * (self._speeds[:3] / 2.0 + lengths * self._rates[:3] / 6.0))
        self._areas = np.concatenate([[0.0], np.cumsum(areas)])

    def at(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return position, speed and acceleration (n,) at ``times`` (n,) [s]; at rest before 0 and after the
        end."""
        area_a, way_a, speed_a = self._plain(times - WINDOW_S)
        area_b, way_b, speed_b = self._plain(times)
        return (area_b - area_a) / WINDOW_S, (way_b - way_a) / WINDOW_S, (speed_b - speed_a) / WINDOW_S

    def time_at(self, way: float) -> float:
        """Return the time at which position ``way``, 0 to 1, is reached [s]."""
        low, high = 0.0, self.duration
        for _ in range(50):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self.at(np.array([middle]))[0][0] < way else (low, middle)
        return high

    def _plain(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The trapezoid's position, its integral and its speed (n,)."""
        times = np.maximum(times, 0.0)
        i = np.searchsorted(self._begins, times, side="right") - 1
        t, way, speed, rate = times - self._begins[i], self._ways[i], self._speeds[i], self._rates[i]
        area = self._areas[i] + t * (way + t * (speed / 2.0 + t * rate / 6.0))
        return area, way + t * (speed + t * rate / 2.0), speed + t * rate
