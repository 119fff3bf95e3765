# SPDX-License-Identifier: BSD-3-Clause
"""Times for given points: a cubic spline in time goes through all of them, within the limits."""
from __future__ import annotations

import math

import numpy as np

from motion_planning.timing.kernels import greatest_speeds, peaks_of_cubics, second_derivatives
from motion_planning.timing.timed import Timed

_ROUNDS = 60
# A segment is stretched by a little more than its excess, or the last rounds would crawl.
_PUSH = 1.01


def through_points(path: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray, rest_acceleration: bool) -> Timed:
    """Return a Timed through all points of ``path`` (m, k), m at least 2, from rest to rest; limits (k,).

    rest_acceleration: also with acceleration 0 at both ends; a point is added behind the first and before the last.
    Segments in which the spline exceeds a limit are stretched until none is left, or the rounds are used up; what is
    left then is for :func:`within_limits`.
    """
    if rest_acceleration:
        path = _with_end_points(path)
    guesses = [_first_guess(path, velocity, acceleration), _guess_by_curve(path, velocity, acceleration)]
    found = [_stretched(path, durations, velocity, acceleration, rest_acceleration) for durations in guesses]
    return min(found, key=lambda one: one[0])[1]


def _stretched(path: np.ndarray, durations: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray,
               rest_acceleration: bool) -> tuple[float, Timed]:
    """(its duration within the limits [s], the best Timed of the rounds that begin with ``durations``)"""
    found = []
    for _ in range(_ROUNDS):
        timed = _spline(durations, path, rest_acceleration)
        speeds, accelerations = peaks_of_cubics(durations, timed.velocities, timed.accelerations)
        excess = np.maximum((speeds / velocity).max(axis=1), np.sqrt((accelerations / acceleration).max(axis=1)))
        worst = float(excess.max())
        found.append((timed.duration * max(1.0, worst), timed))
        if worst <= 1.0:
            break
        durations = durations * np.where(excess > 1.0, _PUSH * np.minimum(excess, 2.0), 1.0)
    return min(found, key=lambda one: one[0])


def _guess_by_curve(path: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
    """Durations (m - 1,) [s] of the time-optimal motion along a curve through the points, as dense ones tell it."""
    widths = np.linalg.norm(np.diff(path, axis=0), axis=1)
    along = np.concatenate([[0.0], np.cumsum(widths)])
    slopes = np.gradient(path, along, axis=0)
    bends = np.gradient(slopes, along, axis=0)
    stop = np.zeros(len(path), dtype=bool)
    stop[[0, -1]] = True
    squared, _ = greatest_speeds(widths, np.stack([slopes[:-1], bends[:-1], slopes[1:], bends[1:]]), velocity,
                                 acceleration, stop)
    speeds = np.sqrt(squared)
    return np.maximum(2.0 * widths / np.maximum(speeds[:-1] + speeds[1:], 1e-9), 1e-4)


def _first_guess(path: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
    """Durations (m - 1,) [s]: no shorter than the velocities ask for, and the ends' than the accelerations."""
    steps = np.abs(np.diff(path, axis=0))
    durations = (steps / velocity).max(axis=1)
    for end in (0, -1):
        durations[end] = max(durations[end], math.sqrt(2.0 * float((steps[end] / acceleration).max())))
    return np.maximum(durations, 1e-4)


def _with_end_points(path: np.ndarray) -> np.ndarray:
    """Points near both ends, on the first and the last line, so that the ends' accelerations can be chosen."""
    first, last = path[0] + 0.1 * (path[1] - path[0]), path[-1] + 0.1 * (path[-2] - path[-1])
    return np.concatenate([path[:1], [first], path[1:-1], [last], path[-1:]])


def _spline(durations: np.ndarray, path: np.ndarray, rest_acceleration: bool) -> Timed:
    """The Timed of a spline with two continuous derivatives, at rest at both ends.

    Second derivatives solve a tridiagonal system (C. de Boor, A Practical Guide to Splines, chapter IV). With
    ``rest_acceleration`` they are 0 at the ends, and the second and the last point but one move instead.
    """
    times = np.concatenate([[0.0], np.cumsum(durations)])
    if rest_acceleration:
        path = _moved_for_rest(durations, path)
    accelerations = second_derivatives(durations, path)
    h = durations[:, None]
    slopes = np.diff(path, axis=0) / h
    velocities = np.empty_like(path)
    velocities[:-1] = slopes - h * (2.0 * accelerations[:-1] + accelerations[1:]) / 6.0
    velocities[-1] = slopes[-1] + h[-1] * (accelerations[-2] + 2.0 * accelerations[-1]) / 6.0
    velocities[0] = velocities[-1] = 0.0
    return Timed(times, path, velocities, accelerations)


def _moved_for_rest(h: np.ndarray, path: np.ndarray) -> np.ndarray:
    """``path`` with points 1 and m - 2 where a clamped spline has second derivative 0 at both ends.

    The ends' second derivatives are affine in the two points, so four splines give the place.
    """
    def ends(moved_by_first: float, moved_by_last: float) -> np.ndarray:
        moved = path.copy()
        moved[1] += moved_by_first
        moved[-2] += moved_by_last
        bends = second_derivatives(h, moved)
        return np.array([bends[0], bends[-1]])

    rest = ends(0.0, 0.0)
    first, last = ends(1.0, 0.0) - rest, ends(0.0, 1.0) - rest
    system = np.array([first, last])  # (2 points, 2 ends, k)
    moved = path.copy()
    for joint in range(path.shape[1]):
        offset = np.linalg.solve(system[:, :, joint].T, -rest[:, joint])
        moved[1, joint] += offset[0]
        moved[-2, joint] += offset[1]
    return moved
