# SPDX-License-Identifier: BSD-3-Clause
"""Converts between control_msgs/FollowJointTrajectory and this package: rows of points and tolerances, error codes.

Reads fields of messages and imports none. Free of ROS.
"""
from __future__ import annotations

import enum
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

from .command import Point, TrajectoryCommand
from .errors import AllPointsInPast, JointNamesError
from .goal_monitor import GoalOutcome
from .tolerances import Row


class ErrorCode(enum.IntEnum):
    """``error_code`` of control_msgs/FollowJointTrajectoryResult."""

    SUCCESSFUL = 0
    INVALID_GOAL = -1
    INVALID_JOINTS = -2
    OLD_HEADER_TIMESTAMP = -3
    PATH_TOLERANCE_VIOLATED = -4
    GOAL_TOLERANCE_VIOLATED = -5


_OF_OUTCOME = {
    GoalOutcome.SUCCEEDED: ErrorCode.SUCCESSFUL,
    GoalOutcome.PATH_TOLERANCE_VIOLATED: ErrorCode.PATH_TOLERANCE_VIOLATED,
    GoalOutcome.GOAL_TOLERANCE_VIOLATED: ErrorCode.GOAL_TOLERANCE_VIOLATED,
}


class GoalTolerances(NamedTuple):
    """The goal's own tolerances, which override the defaults, see :func:`joint_trajectory.merge_tolerances`.

    path, goal: rows of (joint name, position, velocity, acceleration); goal_time_s [s].
    """

    path: Sequence[Row] = ()
    goal: Sequence[Row] = ()
    goal_time_s: float = 0.0


def code_of_outcome(outcome: GoalOutcome) -> int:
    """Return the ErrorCode of a goal that ended with an GoalOutcome, a plain number."""
    return _OF_OUTCOME[outcome].value


def code_of_error(error: Exception | str, start_was_given: bool = False) -> int:
    """Return the ErrorCode of a goal that is refused for ``error``, an exception or a text; a plain number.

    ``start_was_given``: the goal's header has a stamp, which is the error if all points are in the past.
    """
    if isinstance(error, JointNamesError):
        return ErrorCode.INVALID_JOINTS.value
    if isinstance(error, AllPointsInPast) and start_was_given:
        return ErrorCode.OLD_HEADER_TIMESTAMP.value
    return ErrorCode.INVALID_GOAL.value


def rows_of_points(points: Iterable[Any]) -> list[Point]:
    """Return trajectory_msgs/JointTrajectoryPoint[] as rows of (time from start [s], positions, velocities,
    accelerations).
    """
    return [(point.time_from_start.to_sec(), point.positions, point.velocities, point.accelerations)
            for point in points]


def command_of(trajectory: Any, start_time: float | None = None) -> TrajectoryCommand:
    """Return the :class:`TrajectoryCommand` of a trajectory_msgs/JointTrajectory. Raises TrajectoryError, as
    TrajectoryCommand does."""
    return TrajectoryCommand(trajectory.joint_names, rows_of_points(trajectory.points), start_time)


def tolerances_of(goal: Any) -> GoalTolerances:
    """Return the :class:`GoalTolerances` of a control_msgs/FollowJointTrajectoryGoal."""
    return GoalTolerances(_rows(goal.path_tolerance), _rows(goal.goal_tolerance), goal.goal_time_tolerance.to_sec())


def _rows(tolerances: Iterable[Any]) -> list[Row]:
    return [(entry.name, entry.position, entry.velocity, entry.acceleration) for entry in tolerances]
