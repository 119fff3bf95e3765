# SPDX-License-Identifier: BSD-3-Clause
"""The curve through the points of a goal: its polynomials and times. Free of ROS."""
from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from joint_trajectory import Trajectory, smooth_velocities
from joint_trajectory.segment import CUBIC, LINEAR, QUINTIC, constant, splines

from .optimal import time_optimal

if TYPE_CHECKING:
    from joint_trajectory.command import Point


def has_positions_only(points: Sequence[Point]) -> bool:
    """Whether no point of ``points``, rows (time, positions, velocities, accelerations), has more than positions."""
    return not any(len(point[2]) or len(point[3]) for point in points)


def interpolate(times: np.ndarray, points: Sequence[Point], start: np.ndarray | None,
                interpolation: str) -> Trajectory:
    """The :class:`Trajectory` from ``start`` (k,) [rad], or from point 0 if that is None, through the points.

    ``times`` (m,) [s], increasing. From a ``start`` the curve begins at rest, and a point at time 0 is replaced by it.
    ``interpolation``: fields (cubic or quintic by the given fields; for positions alone, cubics without overshoot that
    rest at both ends), linear, cubic or quintic (missing accelerations are 0).
    """
    positions = np.array([point[1] for point in points], dtype=float)
    velocities, accelerations = (
        np.array([row if len(row) else np.zeros(positions.shape[1]) for row in rows], dtype=float)
        for rows in ([point[2] for point in points], [point[3] for point in points]))
    degrees = np.array([_degree(point) for point in points])
    if start is not None:
        first = 1 if times[0] == 0.0 else 0
        rest = np.zeros((1, len(start)))
        degrees = np.concatenate([[degrees[0] if first else QUINTIC], degrees[first:]])
        times = np.concatenate([[0.0], times[first:]])
        positions = np.concatenate([start[None], positions[first:]])
        velocities = np.concatenate([rest, velocities[first:]])
        accelerations = np.concatenate([rest, accelerations[first:]])
    elif times[0] > 0.0:
        times, positions, velocities, accelerations = (
            np.concatenate([row, rows]) for row, rows in (
                ([0.0], times), (positions[:1], positions), (0.0 * velocities[:1], velocities),
                (0.0 * accelerations[:1], accelerations)))
        degrees = np.concatenate([degrees[:1], degrees])
    if interpolation == "linear":
        degrees = np.full(len(times), LINEAR)
    else:
        velocities = np.where((degrees == LINEAR)[:, None], smooth_velocities(times, positions), velocities)
        degrees = np.clip(degrees, QUINTIC if interpolation == "quintic" else CUBIC,
                          CUBIC if interpolation == "cubic" else QUINTIC)
    pieces = splines(times, positions, velocities, accelerations, degrees)
    return _with_end(times, pieces, positions[-1])


def joined(lead_in: Trajectory, way: Trajectory) -> Trajectory:
    """``way`` after ``lead_in``, both :class:`Trajectory` from time 0 on."""
    delay = lead_in.end_time
    return Trajectory(np.concatenate([lead_in.starts[:-1], way.starts + delay]),
                      np.concatenate([lead_in.coefficients[:-1], way.coefficients]), way.end_times + delay)


def fastest(start: np.ndarray, points: Sequence[Point], velocity: np.ndarray,
            acceleration: np.ndarray) -> Trajectory:
    """The time-optimal :class:`Trajectory` from ``start`` (k,) through the positions of the points."""
    return time_optimal(np.concatenate([start[None], [point[1] for point in points]]), velocity, acceleration)


def _with_end(times: np.ndarray, pieces: np.ndarray, end: np.ndarray) -> Trajectory:
    return Trajectory(times, np.concatenate([pieces, constant(end)[None]]), np.full(len(end), times[-1]))


def _degree(point: Point) -> int:
    if not len(point[2]):
        return LINEAR
    return QUINTIC if len(point[3]) else CUBIC
