# SPDX-License-Identifier: BSD-3-Clause
"""Goals of FollowJointTrajectory become rows, errors become its codes."""
from types import SimpleNamespace as Message

import pytest

from joint_trajectory import (
    AllPointsInPast,
    ErrorCode,
    GoalOutcome,
    GoalTolerances,
    NoPoints,
    UnknownJoints,
    code_of_error,
    code_of_outcome,
    command_of,
    tolerances_of,
)


def duration(seconds):
    return Message(to_sec=lambda: seconds)


def tolerance(name, *values):
    return Message(**dict(zip(("name", "position", "velocity", "acceleration"), (name, *values), strict=True)))


def test_trajectory_becomes_a_command():
    points = [Message(time_from_start=duration(seconds), positions=[seconds], velocities=[], accelerations=[])
              for seconds in (1.0, 2.5)]
    command = command_of(Message(joint_names=["turn"], points=points), 7.0)
    assert (command.joint_names, command.times.tolist(), command.positions.tolist(), command.start_time) == (
        ("turn",), [1.0, 2.5], [[1.0], [2.5]], 7.0)


def test_tolerances_keep_path_and_goal_apart():
    goal = Message(path_tolerance=[tolerance("turn", 0.1, 0.2, 0.3)], goal_tolerance=[tolerance("lift", 1.0, 2.0, 3.0)],
                   goal_time_tolerance=duration(0.5))
    assert tolerances_of(goal) == GoalTolerances([("turn", 0.1, 0.2, 0.3)], [("lift", 1.0, 2.0, 3.0)], 0.5)


@pytest.mark.parametrize("error, was_given, code", [
    (UnknownJoints(["lift"], ["turn"]), False, ErrorCode.INVALID_JOINTS), (NoPoints(), True, ErrorCode.INVALID_GOAL),
    ("the robot is not enabled", False, ErrorCode.INVALID_GOAL),
    (AllPointsInPast(3, 0.1), True, ErrorCode.OLD_HEADER_TIMESTAMP),
    (AllPointsInPast(3, 0.1), False, ErrorCode.INVALID_GOAL)])
def test_code_of_a_goal_that_is_refused(error, was_given, code):
    found = code_of_error(error, was_given)
    assert found == code and type(found) is int  # as the message has it


@pytest.mark.parametrize("outcome", GoalOutcome)
def test_every_outcome_has_its_code(outcome):
    found = code_of_outcome(outcome)
    assert type(found) is int and (found == 0) == (outcome is GoalOutcome.SUCCEEDED)
