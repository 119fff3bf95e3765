# SPDX-License-Identifier: BSD-3-Clause
"""The fastest trajectory through poses under limits on velocity and acceleration, by ruckig. Free of ROS."""
from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING

import numpy as np
import ruckig

from joint_trajectory import Trajectory, smooth_velocities
from joint_trajectory.segment import constant

from .timing import arrival_times

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

# Shares of the reference velocity that are tried at each inner pose; 0 is a stop there.
_SHARES = (1.0, 0.8, 0.6, 0.4, 0.2, 0.0)
# With more poses than this only the outer two shares are tried, so that thousands of poses take a second.
_MANY_POSES = 500
# Rounding tolerance of a joint beyond the span of a segment's ends [rad].
_OVERSHOOT = 1e-6
# Poses that differ by less than this in each joint count as one [rad].
_SAME_POSE = 1e-9
# Changes of acceleration within this time count as one [s].
_SAME_TIME_S = 1e-9


def time_optimal(path: ArrayLike, velocity: ArrayLike, acceleration: ArrayLike) -> Trajectory:
    """The :class:`Trajectory` from rest through the poses ``path`` (m, n) [rad] to rest, from time 0 on.

    ``velocity`` [rad/s], ``acceleration`` [rad/s^2]: limits (n,).

    Between two poses each joint moves from one velocity to the other as fast as possible and stays between the two
    positions; all joints arrive together. The velocities at the poses are chosen over the whole path (dynamic
    programming), among shares of one with which no joint needs to reverse. A joint that reverses its direction rests at
    that pose.
    """
    path = np.asarray(path, dtype=float)
    velocity, acceleration = np.asarray(velocity, dtype=float), np.asarray(acceleration, dtype=float)
    differs = (np.abs(np.diff(path, axis=0)) > _SAME_POSE).any(axis=1)
    path = path[np.concatenate([[True], differs])]
    count = path.shape[1]
    starts, pieces = [0.0], []
    for segment in _fastest(path, velocity, acceleration):
        begins = _changes(segment)
        for begin, until in itertools.pairwise(begins):
            pieces.append(_piece(segment, begin, until))
            starts.append(starts[-1] + until - begin)
    pieces.append(constant(path[-1]))
    return Trajectory(np.array(starts), np.array(pieces), np.full(count, starts[-1]))


def _fastest(path: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray) -> list[ruckig.Trajectory]:
    """The ruckig trajectories of the segments, with the velocities at the poses that give the shortest time."""
    shares = _SHARES if len(path) <= _MANY_POSES else (_SHARES[0], _SHARES[-1])
    reference = _reference_velocities(path, velocity, acceleration)
    candidates = [np.unique(np.outer(shares, row), axis=0) for row in reference]
    solver = _Solver(velocity, acceleration)
    # cost[k]: shortest time up to here with candidate k; choice: which candidate before leads to it.
    cost, choices = np.zeros(1), []
    for here, there, before, after in zip(path[:-1], path[1:], candidates[:-1], candidates[1:], strict=True):
        table = cost[:, None] + np.array([[solver.duration(here, v0, there, v1) for v1 in after] for v0 in before])
        choices.append(np.argmin(table, axis=0))
        cost = table.min(axis=0)
    chosen = [0]
    for choice in reversed(choices):
        chosen.append(int(choice[chosen[-1]]))
    speeds = [rows[k] for rows, k in zip(candidates, reversed(chosen), strict=True)]
    return [solver.solve(here, v0, there, v1) for here, v0, there, v1 in zip(
        path[:-1], speeds[:-1], path[1:], speeds[1:], strict=True)]


def _reference_velocities(path: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
    """(m, n): velocities at the poses, 0 at both ends, with which a segment of any duration has no overshoot."""
    if len(path) < 3:
        return np.zeros_like(path)
    reference = smooth_velocities(np.array(arrival_times(path, velocity, 0.0)), path)
    # Half of each segment is reserved for deceleration.
    shortest = np.minimum(np.abs(np.diff(path[:-1], axis=0)), np.abs(np.diff(path[1:], axis=0)))
    reference[1:-1] = np.clip(reference[1:-1], -np.sqrt(acceleration * shortest), np.sqrt(acceleration * shortest))
    return np.clip(reference, -velocity, velocity)


class _Solver:
    """Ruckig for one set of limits."""

    def __init__(self, velocity: np.ndarray, acceleration: np.ndarray) -> None:
        self._solver = ruckig.Ruckig(len(velocity))
        self._input = ruckig.InputParameter(len(velocity))
        self._input.max_velocity, self._input.max_acceleration = velocity.tolist(), acceleration.tolist()
        # From rest to rest all joints move in proportion: straight lines.
        self._input.synchronization = ruckig.Synchronization.Phase
        self._trial = ruckig.Trajectory(len(velocity))

    def duration(self, here: np.ndarray, start_velocity: np.ndarray, there: np.ndarray,
                 end_velocity: np.ndarray) -> float:
        """Duration of the segment [s]; inf if there is none, or if a joint leaves the span of its ends."""
        if not self._calculate(here, start_velocity, there, end_velocity, self._trial):
            return math.inf
        low, high = np.minimum(here, there) - _OVERSHOOT, np.maximum(here, there) + _OVERSHOOT
        for extrema, lower, upper in zip(self._trial.position_extrema, low, high, strict=True):
            if extrema.min < lower or extrema.max > upper:
                return math.inf
        return self._trial.duration

    def solve(self, here: np.ndarray, start_velocity: np.ndarray, there: np.ndarray,
              end_velocity: np.ndarray) -> ruckig.Trajectory:
        found = ruckig.Trajectory(len(here))
        self._calculate(here, start_velocity, there, end_velocity, found)
        return found

    def _calculate(self, here: np.ndarray, start_velocity: np.ndarray, there: np.ndarray, end_velocity: np.ndarray,
                   found: ruckig.Trajectory) -> bool:
        self._input.current_position, self._input.current_velocity = here.tolist(), start_velocity.tolist()
        self._input.target_position, self._input.target_velocity = there.tolist(), end_velocity.tolist()
        return self._solver.validate_input(self._input) and self._solver.calculate(self._input, found) in (
            ruckig.Result.Working, ruckig.Result.Finished)


def _changes(segment: ruckig.Trajectory) -> list[float]:
    """Times [s] from 0 to the segment's end at which the acceleration of any joint changes."""
    times = [0.0, segment.duration]
    for profile in segment.profiles[0]:
        times.extend(itertools.accumulate([profile.brake.duration, *profile.t]))
    times = np.unique(np.clip(times, 0.0, segment.duration))
    kept = times[np.concatenate([[True], np.diff(times) > _SAME_TIME_S])]
    kept[-1] = segment.duration
    return kept.tolist()


def _piece(segment: ruckig.Trajectory, begin: float, until: float) -> np.ndarray:
    """(6, n): the polynomial between two changes, of constant acceleration."""
    coefficients = np.zeros((6, segment.degrees_of_freedom))
    coefficients[0], coefficients[1], _ = segment.at_time(begin)
    coefficients[2] = np.divide(segment.at_time(0.5 * (begin + until))[2], 2.0)
    return coefficients
