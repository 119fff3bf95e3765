# SPDX-License-Identifier: BSD-3-Clause
"""The fastest motion along a curve under limits of joint velocity and acceleration.

H. Pham, Q.-C. Pham: A New Approach to Time-Optimal Path Parameterization Based on Reachability Analysis (T-RO 2018):
on a grid of the path parameter s, squared speeds x = (ds/dt)**2 and accelerations u = d2s/dt2 obey linear
constraints; a pass backwards finds the greatest x from which the end can be reached, a pass forwards takes the
greatest u. The curve's second derivative jumps between pieces, so constraints hold for each interval by itself, with
the derivatives at both of its ends.
"""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from motion_planning.timing.kernels import greatest_speeds

if TYPE_CHECKING:
    from motion_planning.timing.rounded import RoundedPath

# Intervals of the whole curve, and the greatest turn [rad] of an arc within one.
_INTERVALS = 200
_TURN = 0.1
# Gauss-Legendre nodes and weights on [-1, 1], for means over a window of time.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(6)


def fastest(curve: RoundedPath, velocity: np.ndarray, acceleration: np.ndarray) -> CurveMotion:
    """Return the fastest :class:`CurveMotion` along a RoundedPath, from rest to rest; limits (k,) above 0."""
    s, derivatives, stops = curve.grid(curve.length / _INTERVALS, _TURN)
    stop = np.zeros(len(s), dtype=np.bool_)
    stop[[0, -1, *stops]] = True
    squared, rates = greatest_speeds(np.diff(s), derivatives, velocity, acceleration, stop)
    return CurveMotion(curve, s, squared, rates)


class CurveMotion:
    """A motion along a curve: s(t) is a parabola on each interval of the grid. duration [s]."""

    def __init__(self, curve: RoundedPath, s: np.ndarray, squared: np.ndarray, rates: np.ndarray) -> None:
        """s, squared (n + 1,): the grid and (ds/dt)**2 there; rates (n,): d2s/dt2 in the intervals."""
        self._curve, self._s, self._rates = curve, s, rates
        self._speeds = np.sqrt(squared)
        self._times = np.concatenate([[0.0], np.cumsum(2.0 * np.diff(s) / (self._speeds[:-1] + self._speeds[1:]))])
        self.duration = float(self._times[-1])

    def at(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions and velocities (n, k) at ``times`` (n,) [s]; at rest before 0 and after the end."""
        inside = np.clip(times, 0.0, self.duration)
        i = np.clip(np.searchsorted(self._times, inside, side="right") - 1, 0, len(self._rates) - 1)
        since = inside - self._times[i]
        s = np.minimum(self._s[i] + since * (self._speeds[i] + 0.5 * self._rates[i] * since), self._s[i + 1])
        speed = np.where((times > 0.0) & (times < self.duration), self._speeds[i] + self._rates[i] * since, 0.0)
        q, direction = self._curve.at(s)
        return q, direction * speed[:, None]

    def mean(self, times: np.ndarray, window: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Positions, velocities, accelerations (n, k) of the motion's moving mean over ``window`` [s].

        The mean keeps limits on velocity and acceleration, which are convex, makes the acceleration continuous, and
        moves the curve by at most acceleration * window**2 / 24.
        """
        q = sum((0.5 * weight * self.at(times + 0.5 * window * node)[0]
                 for node, weight in zip(_NODES, _WEIGHTS, strict=True)), np.zeros(1))
        q_before, v_before = self.at(times - 0.5 * window)
        q_after, v_after = self.at(times + 0.5 * window)
        return q, (q_after - q_before) / window, (v_after - v_before) / window
