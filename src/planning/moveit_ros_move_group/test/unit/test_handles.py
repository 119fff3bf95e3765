# SPDX-License-Identifier: BSD-3-Clause
"""The handles of controllers: actions and their goals."""
from unittest.mock import Mock

import actionlib
import pytest
import rospy

from moveit_ros_move_group.controllers import FOLLOW, ControllerEntry
from moveit_ros_move_group.handles import ControllerHandles, goal_id


@pytest.mark.parametrize(("remap", "expected"), [
    ({}, "/arm_controller/follow"), ({"/arm_controller/follow": "/eff_controller/follow"}, "/eff_controller/follow")])
def test_a_launch_file_can_remap_a_controllers_action(monkeypatch, remap, expected):
    """As for robots in a simulator. The remap names the resolved name, controller_list a relative one."""
    named = []
    monkeypatch.setattr(actionlib, "ActionClient", lambda name, action_type: named.append(name) or Mock())
    monkeypatch.setattr(rospy.names, "_resolved_mappings", remap)
    ControllerHandles([ControllerEntry("arm_controller", FOLLOW, ("elbow",), "arm_controller/follow")])
    assert named == [expected]


def test_ids_of_goals_end_in_nanoseconds(monkeypatch):
    monkeypatch.setattr(rospy.Time, "now", lambda: rospy.Time(98, 401000000))
    monkeypatch.setattr(rospy, "get_caller_id", lambda: "/move_group")
    first, second = goal_id(), goal_id()
    assert first.stamp == rospy.Time(98, 401000000)
    node, count, seconds = first.id.split("-")
    assert (node, seconds) == ("/move_group", "98.401000000")
    assert second.id == "/move_group-%d-98.401000000" % (int(count) + 1)
