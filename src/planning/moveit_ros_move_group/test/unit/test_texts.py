# SPDX-License-Identifier: BSD-3-Clause
"""Texts that scripts compare."""
from moveit_msgs.msg import MoveItErrorCodes

from moveit_ros_move_group.texts import result_text


def test_texts_are_moveits():
    success = MoveItErrorCodes.SUCCESS
    assert result_text(success) == "Solution was found and executed."
    assert result_text(success, plan_only=True) == "Motion plan was computed succesfully."
    assert result_text(success, empty=True) == "Requested path and goal constraints are already met."
    assert result_text(MoveItErrorCodes.PLANNING_FAILED, empty=True) == "No motion plan found. No execution attempted."
    assert result_text(MoveItErrorCodes.INVALID_GROUP_NAME) == "Invalid group in motion plan request"


def test_reasons_stand_behind():
    assert result_text(MoveItErrorCodes.GOAL_IN_COLLISION, "a touches b") == "GOAL_IN_COLLISION: a touches b"
    assert result_text(MoveItErrorCodes.PLANNING_FAILED, "no way", empty=True).endswith("attempted. no way")
    assert result_text(-99, "x") == "error code -99: x"
