# SPDX-License-Identifier: BSD-3-Clause
"""Follows one trajectory after the other and monitors the active goal."""
from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Generic, TypeVar

import numpy as np
import numpy.typing as npt

from .command import TrajectoryCommand
from .goal_monitor import GoalMonitor, GoalVerdict
from .limits import Limits
from .replacement import Replacement, replace
from .segment import Floats
from .tolerances import Tolerances
from .trajectory import Trajectory, hold, stop

_TURN = 2.0 * math.pi

Goal = TypeVar("Goal")


class Follower(Generic[Goal]):
    """Desired state of n joints. Times [s] are of any one clock that never goes back; one thread only.

    Attributes
    ----------
    trajectory : :class:`Trajectory` The active trajectory.
    desired : (3, n) array
        Desired position, velocity, acceleration of the last :meth:`update`.
    error : (3, n) array
        Desired minus actual of the last :meth:`update`; positions the shorter way round, accelerations 0.
    goal : Goal or None
        The active command's goal: any object of the caller.
    """

    def __init__(self, joint_names: Iterable[str], continuous: npt.ArrayLike | None = None,
                 stop_duration_s: float = 0.0, allow_partial: bool = False, smooth: bool = False,
                 limits: Limits | None = None) -> None:
        """``continuous`` (n,) bool: joints without position limits; ``stop_duration_s`` [s]: duration of a stop, 0:
        hold the present positions at once; ``allow_partial``: commands need not name all joints; ``smooth``: see
        :func:`.replace`; ``limits`` (:class:`Limits`): commands beyond them are refused.

        Call :meth:`start` before any other method.
        """
        self.joint_names = list(joint_names)
        count = len(self.joint_names)
        self._continuous = np.zeros(count, dtype=bool) if continuous is None else np.asarray(continuous, dtype=bool)
        self._stop_duration_s = stop_duration_s
        self._allow_partial = allow_partial
        self._smooth = smooth
        self._limits = limits
        self.trajectory: Trajectory
        self.desired = np.zeros((3, count))
        self.error = np.zeros((3, count))
        self.goal: Goal | None = None
        self._monitor: GoalMonitor | None = None
        self._ahead = np.zeros((3, count))
        self._ahead_of: tuple[Trajectory, float] | None = None
        self._turns = np.zeros(count)
        # Views of the rows, so that no tick needs to make them.
        self._position_error, self._velocity_error = self.error[0], self.error[1]

    def start(self, time_s: float, position: npt.ArrayLike, velocity: npt.ArrayLike) -> None:
        """Hold, or come to rest from, the measured ``position`` and ``velocity`` (n,). No goal."""
        self.goal = self._monitor = None
        self.desired[:2] = position, velocity
        self.desired[2] = 0.0
        self.error[:] = 0.0
        self.trajectory = stop(time_s, np.array(position), np.array(velocity), self._stop_duration_s)

    def accept(self, command: TrajectoryCommand, now: float, position: npt.ArrayLike, goal: Goal | None = None,
               tolerances: Tolerances | None = None) -> Replacement | None:
        """Follow ``command`` from now on; returns the :class:`Replacement`, or None for a command without points.

        ``now`` [s]: the first time that can still be changed, so later than the last :meth:`update`; ``position``
        (n,): measured. A command without points is a stop. With a ``goal`` (any object), the motion is monitored with
        ``tolerances`` (:class:`Tolerances`). A previous goal is forgotten: the caller must tell its owner.

        Raises :class:`TrajectoryError`; nothing has changed then.
        """
        if not len(command.times):
            self.stop(now, position, goal)
            return None
        replacement = replace(self.trajectory, command, now, self.joint_names, self._continuous, self._allow_partial,
                              self._smooth)
        if self._limits is not None:
            self._limits.check(replacement.trajectory, float(replacement.begins.min()),
                               float(replacement.begins.max()))
        self.trajectory = replacement.trajectory
        self._watch(goal, tolerances, replacement.begins)
        return replacement

    def stop(self, now: float, position: npt.ArrayLike, goal: Goal | None = None) -> None:
        """Come to rest: at once at the measured ``position`` (n,), or from the desired state within the stop duration.

        A ``goal`` is reached at the end of the stop, even if the joints still move.
        """
        if self._stop_duration_s > 0.0:
            desired = self.trajectory.sample(now)
            self.trajectory = stop(now, desired[0], desired[1], self._stop_duration_s)
        else:
            self.trajectory = hold(now, np.array(position))
        self._watch(goal, None, np.full(len(self.joint_names), float(now)))

    def release(self) -> None:
        """Forget the goal; continue the trajectory."""
        self.goal = self._monitor = None

    def look_ahead(self, time_s: float) -> Floats:
        """(3, n): desired state at ``time_s``, such as the next tick, if no command comes before; overwritten by the
        next call."""
        self._ahead_of = self.trajectory, time_s
        return self.trajectory.sample(time_s, self._ahead)

    def update(self, time_s: float, position: npt.ArrayLike, velocity: npt.ArrayLike) -> GoalVerdict | None:
        """Fill ``desired`` and ``error`` for the measured ``position``, ``velocity`` (n,) of ``time_s``.

        Returns the goal's :class:`GoalVerdict` when it ends now, else None. After a violation the joints go on along
        their trajectory.
        """
        desired = self.desired
        if self._ahead_of == (self.trajectory, time_s):
            desired[:] = self._ahead
        else:
            self.trajectory.sample(time_s, desired)
        error = self._position_error
        np.subtract(desired[0], position, error)
        np.subtract(desired[1], velocity, self._velocity_error)
        turns = np.multiply(error, 1.0 / _TURN, self._turns)
        np.rint(turns, turns)
        np.multiply(turns, _TURN, turns)
        np.subtract(error, turns, error)
        if self._monitor is None:
            return None
        verdict = self._monitor.check(time_s, self.error)
        if verdict is not None:
            self._monitor = None
        return verdict

    def _watch(self, goal: Goal | None, tolerances: Tolerances | None, begins: Floats) -> None:
        self.goal = goal
        self._monitor = None
        if goal is not None:
            self._monitor = GoalMonitor(self.joint_names, tolerances or Tolerances.none(len(self.joint_names)), begins,
                                        self.trajectory.end_times)
