# SPDX-License-Identifier: BSD-3-Clause
"""Programs find the modules under the names that they import, and the classes make commanders."""
import pytest

from moveit_ros_planning_interface import (
    _moveit_move_group_interface,
    _moveit_planning_scene_interface,
    _moveit_robot_interface,
    _moveit_roscpp_initializer,
)


@pytest.mark.parametrize("module, commander, name, given", [
    (_moveit_move_group_interface, "MoveGroupCommander", "MoveGroupInterface", ("arm", "described", "/a", 5.0)),
    (_moveit_robot_interface, "RobotCommander", "RobotInterface", ("described", "")),
    (_moveit_planning_scene_interface, "SceneCommander", "PlanningSceneInterface", ("/a",))])
def test_each_class_makes_a_commander(monkeypatch, module, commander, name, given):
    asked = []

    class Commander:
        def __init__(self, *arguments):
            asked.append(arguments)

        def get_planning_frame(self):
            return "world"

    monkeypatch.setattr(module, commander, Commander)
    made = getattr(module, name)(*given)
    assert asked == [given] and made.get_planning_frame() == "world"


def test_there_is_no_second_node_to_start_or_to_end():
    assert _moveit_roscpp_initializer.roscpp_init("node", ["a"]) is None
    assert _moveit_roscpp_initializer.roscpp_shutdown() is None
