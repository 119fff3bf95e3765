# SPDX-License-Identifier: BSD-3-Clause
"""Decides whether a goal is reached or missed."""
from __future__ import annotations

import enum
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from .segment import Floats
from .tolerances import Tolerances

Flags = npt.NDArray[np.bool_]
_QUANTITIES = ("position", "velocity", "acceleration")


class GoalOutcome(enum.Enum):
    """How a goal ended."""

    SUCCEEDED = "succeeded"
    PATH_TOLERANCE_VIOLATED = "path"
    GOAL_TOLERANCE_VIOLATED = "goal"


class GoalVerdict(NamedTuple):
    """The end of a goal. After a failure: which ``joint``, by which ``quantity`` and ``error``, beyond which
    ``tolerance`` [rad or m, per s, per s^2]. ``text`` says it in words and is empty for success."""

    outcome: GoalOutcome
    text: str = ""
    joint: str = ""
    quantity: str = ""
    error: float = 0.0
    tolerance: float = 0.0


class GoalMonitor:
    """Watches n joints while they follow one goal.

    From ``begins`` to ``ends`` a joint must keep the path tolerance; from ``ends`` on it has ``goal_time_s`` to come
    within the goal tolerance once. The goal succeeds when every joint has.
    """

    def __init__(self, joint_names: Sequence[str], tolerances: Tolerances, begins: Floats, ends: Floats) -> None:
        """``begins``, ``ends``: (n,) [s]."""
        self._joint_names = joint_names
        self._tolerances = tolerances
        self._begins = begins
        self._ends = ends
        self._begin = float(begins.min())
        self._all_from, self._all_until = float(begins.max()), float(ends.min())
        self._watches_path = bool(np.isfinite(tolerances.path).any())
        self._done = np.zeros(len(joint_names), dtype=bool)
        self._size = np.empty((3, len(joint_names)))
        self._within = np.empty((3, len(joint_names)), dtype=bool)

    def check(self, time_s: float, error: Floats) -> GoalVerdict | None:
        """The :class:`GoalVerdict`, or None while it is open. ``error`` (3, n): desired minus actual at ``time_s``."""
        if time_s < self._begin:
            return None
        size = np.abs(error, out=self._size)
        if self._all_from <= time_s < self._all_until:
            # The usual case: all joints are still moving.
            if self._watches_path and not np.less_equal(size, self._tolerances.path, out=self._within).all():
                return self._path_verdict(time_s, error, ~self._within)
            return None
        begun = time_s >= self._begins
        ended = begun & (time_s >= self._ends)
        # Not "greater than", so that NaN counts as beyond every tolerance.
        off_path = ~(size <= self._tolerances.path) & (begun & ~ended)
        if off_path.any():
            return self._path_verdict(time_s, error, off_path)
        off_goal = ~(size <= self._tolerances.goal) & (ended & ~self._done)
        self._done |= ended & ~off_goal.any(axis=0)
        if self._done.all():
            return GoalVerdict(GoalOutcome.SUCCEEDED)
        off_goal &= time_s >= self._ends + self._tolerances.goal_time_s
        if off_goal.any():
            return self._goal_verdict(time_s, error, off_goal)
        return None

    def _path_verdict(self, time_s: float, error: Floats, where: Flags) -> GoalVerdict:
        joint, row = np.argwhere(where.T)[0]
        return self._verdict(GoalOutcome.PATH_TOLERANCE_VIOLATED, joint, row, error, self._tolerances.path,
                             "at %.3f s" % (time_s - self._begin))

    def _goal_verdict(self, time_s: float, error: Floats, where: Flags) -> GoalVerdict:
        joint, row = np.argwhere(where.T)[0]
        return self._verdict(GoalOutcome.GOAL_TOLERANCE_VIOLATED, joint, row, error, self._tolerances.goal,
                             "%.3f s after the end" % (time_s - self._ends[joint]))

    def _verdict(self, outcome: GoalOutcome, joint: int, row: int, error: Floats, tolerances: Floats,
                 when: str) -> GoalVerdict:
        name, quantity = self._joint_names[joint], _QUANTITIES[row]
        found, allowed = float(error[row, joint]), float(tolerances[row, joint])
        text = "%s %s error %f (%s, tolerance %g) %s" % (name, outcome.value, found, quantity, allowed, when)
        return GoalVerdict(outcome, text, name, quantity, found, allowed)
