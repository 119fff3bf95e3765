# SPDX-License-Identifier: BSD-3-Clause
"""Straight lines of an arm's tip that keep its orientation, on one branch of the inverse kinematics. Free of ROS."""
from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from arm_kinematics import Budget, Chain, NoSolution, Reason, solve

from .optimal import time_optimal

# Distance between two solutions [m]: default, and minimum where the joints turn fast or the reach ends.
_STEP_M, _SHORTEST_STEP_M = 0.005, 0.0005
# The next solution must be within this distance, else it is on another branch [rad].
_SAME_BRANCH = 0.15
# Only the solution next to the previous one, and very exact: the path is differentiated twice.
_BUDGET = Budget(candidates=1, max_starts=1, tolerance_m=1e-8, tolerance_rad=1e-8)
# A joint this near to a limit [rad] counts as at the limit.
_STUCK = 1e-3
# Share of the accelerations for the curvature of the path in joint space; the rest is for speeding up.
_CURVATURE_SHARE = 0.5


class LeavesReach(ValueError):
    """The line cannot be followed to its end: only ``reached_m`` of ``length_m``; the text says why."""

    def __init__(self, reached_m: float, length_m: float, why: str) -> None:
        super().__init__("the line leaves the arm's reach after %.3f m of %.3f m: %s" % (reached_m, length_m, why))
        self.reached_m, self.length_m = reached_m, length_m


class _NoNext(Exception):
    """There is no next solution on the branch; `is_beyond`: nor on any other. The text says why."""

    def __init__(self, why: str, is_beyond: bool = False) -> None:
        super().__init__(why)
        self.is_beyond = is_beyond


class StraightLine(NamedTuple):
    """``distances`` (m,) [m] along the line and the ``positions`` (m, n) [rad] of the joints there."""

    distances: np.ndarray
    positions: np.ndarray

    def timed(self, velocity: np.ndarray, acceleration: np.ndarray,
              speed: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(times (m,) [s], positions (m, n), velocities (m, n)): points that give a smooth move when joined by cubics.

        The tip speeds up, continues at ``speed`` [m/s], and slows down, all as fast as ``velocity`` [rad/s] and
        ``acceleration`` [rad/s^2] (n,) allow along the whole line.
        """
        slope = np.gradient(self.positions, self.distances, axis=0, edge_order=2 if len(self.distances) > 2 else 1)
        bend = np.abs(np.gradient(slope, self.distances, axis=0)).max(axis=0)
        steepest = np.abs(slope).max(axis=0)
        with np.errstate(divide="ignore"):
            fastest = min(speed, (velocity / steepest).min(),
                          np.sqrt(_CURVATURE_SHARE * acceleration / bend).min())
            push = ((1.0 - _CURVATURE_SHARE) * acceleration / steepest).min()
        way = time_optimal([[0.0], [self.distances[-1]]], [fastest], [push])
        grid = np.linspace(0.0, way.end_time, 20 * len(self.distances) + 1)
        samples = np.array([way.sample(t)[:2, 0] for t in grid])
        times = np.interp(self.distances, samples[:, 0], grid)
        times[-1] = way.end_time
        return times, self.positions, slope * np.array([[way.sample(t)[1, 0]] for t in times])


def straight_line(chain: Chain, start: Sequence[float] | np.ndarray,
                  displacement: Sequence[float] | np.ndarray) -> StraightLine:
    """The :class:`StraightLine` of the tip of ``chain`` from the posture ``start`` (n,) [rad].

    ``displacement`` (3,) [m] is in the base frame of the chain. Each solution is searched from the previous one, and
    must be near it. Raises LeavesReach, and ValueError for an invalid displacement.
    """
    displacement = np.asarray(displacement, dtype=float)
    length = float(np.linalg.norm(displacement)) if displacement.shape == (3,) else math.nan
    if not math.isfinite(length) or length < _SHORTEST_STEP_M:
        raise ValueError("the displacement must be three finite numbers, %g m or more; got %s" % (
            _SHORTEST_STEP_M, displacement.tolist()))
    path = [np.asarray(start, dtype=float)]
    pose = chain.fk(path[0])
    origin = pose[:3, 3].copy()
    distances = [0.0]
    usual = min(_STEP_M, length / 2.0)
    # The error of a pose without any solution, and its distance.
    beyond, beyond_m = "", math.inf
    step = usual
    while distances[-1] < length:
        # Avoid a very short last step.
        left = length - distances[-1]
        distance = length if left <= 1.5 * step else distances[-1] + step
        pose[:3, 3] = origin + displacement * (distance / length)
        try:
            path.append(_next(chain, pose, path[-1]))
        except _NoNext as why:
            if why.is_beyond:
                beyond, beyond_m = str(why), distance
            if step <= _SHORTEST_STEP_M:
                # Near the end of its reach an arm first turns fast or needs another configuration, then has no
                # solution: the latter is the better reason.
                raise LeavesReach(distances[-1], length,
                                  beyond if beyond_m - distances[-1] <= usual else str(why)) from None
            step /= 2.0
        else:
            distances.append(distance)
            step = min(2.0 * step, usual)
    return StraightLine(np.array(distances), np.array(path))


def _next(chain: Chain, pose: np.ndarray, before: np.ndarray) -> np.ndarray:
    """The solution (n,) for ``pose`` on the branch of ``before``. Raises _NoNext."""
    try:
        found = solve(chain, pose, before, budget=_BUDGET).q
    except NoSolution as error:
        if error.reason is not Reason.NOT_CONVERGED:
            raise _NoNext(str(error), is_beyond=True) from None
        stuck = [name for name, angle, low, high in zip(chain.joint_names, error.best, chain.lower, chain.upper,
                                                        strict=True) if not low + _STUCK < angle < high - _STUCK]
        raise _NoNext("this way of holding the arm ends here%s; start in another posture" % (
            ", with %s at its limit" % ", ".join(stuck) if stuck else "")) from None
    turn = np.abs(found - before)
    joint = int(turn.argmax())
    if turn[joint] > _SAME_BRANCH:
        raise _NoNext("%s would have to turn by %.3f rad at once, to another way of holding the arm; start in another "
                      "posture" % (chain.joint_names[joint], turn[joint]))
    return found
