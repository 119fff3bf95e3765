# SPDX-License-Identifier: BSD-3-Clause
"""What controllers are spoken to by."""
import actionlib
import pytest
import rospy

from moveit_ros_move_group.controllers import FOLLOW, Controller
from moveit_ros_move_group.handles import Handles


@pytest.mark.parametrize(("remap", "expected"), [
    ({}, "/arm_controller/follow"), ({"/arm_controller/follow": "/eff_controller/follow"}, "/eff_controller/follow")])
def test_a_launch_file_can_remap_a_controllers_action(monkeypatch, remap, expected):
    """As for robots in a simulator. The remap names the resolved name, controller_list a relative one."""
    named = []
    monkeypatch.setattr(actionlib, "ActionClient", lambda name, action_type: named.append(name))
    monkeypatch.setattr(rospy.names, "_resolved_mappings", remap)
    Handles([Controller("arm_controller", FOLLOW, ("elbow",), "arm_controller/follow")])
    assert named == [expected]
