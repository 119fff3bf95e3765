# SPDX-License-Identifier: BSD-3-Clause
"""From a path of joints to a trajectory: when each point is passed, within limits of velocity and acceleration.

The limits hold between the points too, as controllers interpolate them (``joint_trajectory``: quintic polynomials).
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from motion_planning.errors import PlanningError
from motion_planning.timing.profile import fastest
from motion_planning.timing.rounded import RoundedPath
from motion_planning.timing.timed import Timed, within_limits
from motion_planning.timing.waypoints import through_points

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

# How far [rad or m, Euclidean over the joints] the time-optimal algorithms may cut a corner, unless told.
TOLERANCE = 0.05
# Jerk limit of "ruckig" in units of the acceleration limit [1/s]: full acceleration builds up in a tenth of a second.
JERK_PER_ACCELERATION = 10.0
# The mean over this time [s] makes a time-optimal profile's accelerations continuous; points are half of it apart.
WINDOW_S = 0.1

ALGORITHMS = ("iterative_time_parameterization", "iterative_spline_parameterization",
              "time_optimal_trajectory_generation", "ruckig")
# A longer motion [s] is refused: controllers would get more points than they can hold.
LONGEST_S = 10000.0
# Points nearer than this [rad or m, in every joint] are one.
_SAME = 1e-9

__all__ = ["ALGORITHMS", "LONGEST_S", "TOLERANCE", "Timed", "TimingError", "time_path", "within_limits"]


class TimingError(PlanningError):
    """A path that cannot be timed, with the reason."""


def time_path(path: ArrayLike, velocity: ArrayLike, acceleration: ArrayLike,
              algorithm: str = "time_optimal_trajectory_generation", *, tolerance: float = TOLERANCE) -> Timed:
    """Return the path as a :class:`Timed` that starts and ends at rest.

    path (m, k): joint values [rad or m]; velocity, acceleration (k,): limits, above 0. algorithm: one of
    :data:`ALGORITHMS`, or "time_optimal" for short:

    - time_optimal_trajectory_generation: along the straight lines between the points, corners rounded within
      ``tolerance``; points of the answer are equally spaced in time;
    - ruckig: the same with jerk limited to ``JERK_PER_ACCELERATION`` times the acceleration limit;
    - iterative_time_parameterization: through every point of the path, by cubic splines; equal points become one;
    - iterative_spline_parameterization: the same, with acceleration 0 at both ends (two points are added).

    Raises TimingError for a path or limits that are not finite, of the wrong shape, or not above 0, for limits that
    make it longer than ``LONGEST_S``, and ValueError for an unknown algorithm.
    """
    if algorithm == "time_optimal":
        algorithm = "time_optimal_trajectory_generation"
    if algorithm not in ALGORITHMS:
        raise ValueError("no time parameterization '%s'; there are %s" % (algorithm, ", ".join(ALGORITHMS)))
    path, velocity, acceleration = _checked(path, velocity, acceleration)
    path = path[np.concatenate([[True], np.abs(np.diff(path, axis=0)).max(axis=1) > _SAME])]
    _check_duration(path, velocity, acceleration)
    if len(path) == 1:
        rest = np.zeros_like(path)
        return Timed(np.zeros(1), path, rest, rest)
    if algorithm == "iterative_time_parameterization":
        timed = through_points(path, velocity, acceleration, rest_acceleration=False)
    elif algorithm == "iterative_spline_parameterization":
        timed = through_points(path, velocity, acceleration, rest_acceleration=True)
    else:
        window = WINDOW_S if algorithm != "ruckig" else 2.0 / JERK_PER_ACCELERATION
        timed = _time_optimal(path, velocity, acceleration, tolerance, window)
    return within_limits(timed, velocity, acceleration)


def _checked(path: ArrayLike, velocity: ArrayLike,
             acceleration: ArrayLike) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    try:
        path, velocity, acceleration = (np.array(values, dtype=float) for values in (path, velocity, acceleration))
    except (TypeError, ValueError):
        raise TimingError("path and limits must be arrays of numbers") from None
    if path.ndim != 2 or not path.size:
        raise TimingError("a path is an array (points, joints) with at least one of each, got shape %s" % (path.shape,))
    for name, limit in (("velocity", velocity), ("acceleration", acceleration)):
        if limit.shape != path.shape[1:]:
            raise TimingError("%d joints but %s limits of shape %s" % (path.shape[1], name, limit.shape))
        if not (limit > 0.0).all() or not np.isfinite(limit).all():
            raise TimingError("%s limits must be finite and above 0, got %s" % (name, limit.tolist()))
    if not np.isfinite(path).all():
        raise TimingError("point %d of the path is not finite" % np.argwhere(~np.isfinite(path))[0][0])
    return path, velocity, acceleration


def _check_duration(path: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray) -> None:
    """Raise TimingError where no motion could be short enough: at full speed, and from rest to rest on one line."""
    way = np.abs(np.diff(path, axis=0)).sum(axis=0)
    far = np.abs(path - path[0]).max(axis=0)
    with np.errstate(over="ignore"):
        least = max(float((way / velocity).max()), float(2.0 * np.sqrt(far / acceleration).max()))
    if not least <= LONGEST_S:
        raise TimingError("limits of %s rad/s and %s rad/s^2 make the motion last %.3g s, the most is %g; are the "
                          "scaling factors meant?" % (np.array2string(velocity, precision=3),
                                                      np.array2string(acceleration, precision=3), least, LONGEST_S))


def _time_optimal(path: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray, tolerance: float,
                  window: float) -> Timed:
    rounded = RoundedPath(path, tolerance)
    motion = fastest(rounded, velocity, acceleration)
    intervals = max(4, math.ceil((motion.duration + window) / (0.5 * window)))
    times = np.linspace(0.0, motion.duration + window, intervals + 1)
    return Timed(times, *motion.mean(times - 0.5 * window, window))
