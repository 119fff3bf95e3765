# SPDX-License-Identifier: BSD-3-Clause
"""Compiled inner loops: the time-optimal profile, and splines through given points."""
from __future__ import annotations

import numpy as np

from disk_cache.compiled import compiler

_compiled = compiler("motion_planning_timing", [__file__], nogil=True)
_TINY = 1e-12


@_compiled
def _range_of_rate(x: float, gain: np.ndarray, offset: np.ndarray, limits: np.ndarray, low: np.ndarray,
                   high: np.ndarray) -> tuple[float, float, float, float]:
    """The range of u under |gain u + offset x| <= limits and low[0] + low[1] x <= u <= high[0] + high[1] x.

    Returns both ends, each with its slope over x: lower, its slope, upper, its slope.
    """
    lower, lower_slope = low[0] + low[1] * x, low[1]
    upper, upper_slope = high[0] + high[1] * x, high[1]
    for j in range(len(gain)):
        size = abs(gain[j])
        if size < _TINY:
            continue
        slope = -offset[j] / gain[j]
        reach = limits[j] / size
        if slope * x - reach > lower:
            lower, lower_slope = slope * x - reach, slope
        if slope * x + reach < upper:
            upper, upper_slope = slope * x + reach, slope
    return lower, lower_slope, upper, upper_slope


@_compiled
def greatest_speeds(widths: np.ndarray, derivatives: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray,
                    stop: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Squared speeds (n + 1,) at the ends of n intervals and accelerations (n,) within, both along the curve.

    widths (n,); derivatives (4, n, k): first and second of the joints by the curve's parameter at the left end of
    each interval, then at the right; velocity, acceleration (k,): limits; stop (n + 1,): where to be at rest.
    """
    left1, left2, right1, right2 = derivatives[0], derivatives[1], derivatives[2], derivatives[3]
    n, k = left1.shape
    limit = np.full(n + 1, np.inf)
    gain, offset, limits = np.empty((n, 2 * k)), np.empty((n, 2 * k)), np.empty(2 * k)
    for j in range(k):
        limits[j] = acceleration[j]
        limits[k + j] = acceleration[j]
    for i in range(n):
        for j in range(k):
            if abs(left1[i, j]) > _TINY:
                limit[i] = min(limit[i], (velocity[j] / left1[i, j]) ** 2)
            if abs(right1[i, j]) > _TINY:
                limit[i + 1] = min(limit[i + 1], (velocity[j] / right1[i, j]) ** 2)
            gain[i, j], offset[i, j] = left1[i, j], left2[i, j]
            gain[i, k + j], offset[i, k + j] = right1[i, j] + 2.0 * widths[i] * right2[i, j], right2[i, j]
        for j in range(2 * k):
            if abs(gain[i, j]) < _TINY and abs(offset[i, j]) > _TINY:
                limit[i] = min(limit[i], limits[j] / abs(offset[i, j]))
    for i in range(n + 1):
        if stop[i]:
            limit[i] = 0.0
    squared, rates = np.zeros(n + 1), np.zeros(n)
    low, high = np.empty(2), np.empty(2)
    # Backwards: the greatest x from which what comes after can be kept. The room for u shrinks with x along straight
    # lines, so Newton's method from above ends on the corner of two of them.
    for i in range(n - 1, -1, -1):
        low[0], low[1] = 0.0, -0.5 / widths[i]
        high[0], high[1] = 0.5 * limit[i + 1] / widths[i], -0.5 / widths[i]
        x = limit[i]
        for _ in range(4 * k + 4):
            lower, lower_slope, upper, upper_slope = _range_of_rate(x, gain[i], offset[i], limits, low, high)
            gap, slope = lower - upper, lower_slope - upper_slope
            if gap <= 1e-12 * (1.0 + abs(lower)):
                break
            if slope <= 0.0:
                x = 0.0
                break
            x = max(0.0, x - gap / slope)
        limit[i] = x
    for i in range(n):
        low[0], low[1] = 0.0, -0.5 / widths[i]
        high[0], high[1] = 0.5 * limit[i + 1] / widths[i], -0.5 / widths[i]
        _, _, upper, _ = _range_of_rate(squared[i], gain[i], offset[i], limits, low, high)
        squared[i + 1] = min(limit[i + 1], max(0.0, squared[i] + 2.0 * widths[i] * upper))
        rates[i] = 0.5 * (squared[i + 1] - squared[i]) / widths[i]
    return squared, rates


@_compiled
def second_derivatives(h: np.ndarray, path: np.ndarray) -> np.ndarray:
    """Those (m, k) of the spline through ``path`` (m, k) with durations ``h`` (m - 1,), at rest at both ends.

    Thomas's algorithm; the system is diagonally dominant.
    """
    m, k = path.shape
    diagonal, result = np.empty(m), np.empty((m, k))
    for i in range(m):
        before, after = (h[i - 1] if i > 0 else 0.0), (h[i] if i < m - 1 else 0.0)
        diagonal[i] = 2.0 * (before + after)
        for j in range(k):
            left = (path[i, j] - path[i - 1, j]) / before if i > 0 else 0.0
            right = (path[i + 1, j] - path[i, j]) / after if i < m - 1 else 0.0
            result[i, j] = 6.0 * (right - left)
    for i in range(1, m):
        factor = h[i - 1] / diagonal[i - 1]
        diagonal[i] -= factor * h[i - 1]
        for j in range(k):
            result[i, j] -= factor * result[i - 1, j]
    for j in range(k):
        result[m - 1, j] /= diagonal[m - 1]
    for i in range(m - 2, -1, -1):
        for j in range(k):
            result[i, j] = (result[i, j] - h[i] * result[i + 1, j]) / diagonal[i]
    return result


@_compiled
def peaks_of_cubics(h: np.ndarray, velocities: np.ndarray, accelerations: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The greatest speeds and accelerations (m - 1, k) of cubics that last ``h`` (m - 1,), from what they have at their
    ends (m, k)."""
    m, k = velocities.shape
    speeds, greatest = np.empty((m - 1, k)), np.empty((m - 1, k))
    for i in range(m - 1):
        for j in range(k):
            a, b = accelerations[i, j], accelerations[i + 1, j]
            speed = max(abs(velocities[i, j]), abs(velocities[i + 1, j]))
            if a * b < 0.0:
                speed = max(speed, abs(velocities[i, j] + 0.5 * a * h[i] * a / (a - b)))
            speeds[i, j], greatest[i, j] = speed, max(abs(a), abs(b))
    return speeds, greatest
