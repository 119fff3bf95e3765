# SPDX-License-Identifier: BSD-3-Clause
"""RobotCommander: names, parts, state."""
import math

import numpy as np
import pytest
from moveit_msgs.msg import MoveGroupResult, RobotState
from sensor_msgs.msg import JointState
from visualization_msgs.msg import Marker

from motion_planning.model import PlanningModel
from moveit_commander import MoveGroupCommander, MoveItCommanderException, RobotCommander, conversions
from moveit_commander.markers import link_markers


@pytest.fixture
def robot(connection):
    return RobotCommander()


def test_names(robot):
    assert robot.get_planning_frame() == "world" and robot.get_root_link() == "base"
    assert robot.get_group_names() == ["arm", "hand", "all"]
    assert robot.has_group("arm") and not robot.has_group("leg")
    assert robot.get_joint_names() == ["stand", "shoulder", "elbow", "flange", "grip", "oppose"]
    assert robot.get_joint_names("arm") == ["shoulder", "elbow", "flange"]
    assert robot.get_active_joint_names() == ["shoulder", "elbow", "grip"]
    assert robot.get_active_joint_names("hand") == ["grip"]
    assert robot.get_link_names() == ["base", "upper", "lower", "tool", "finger", "thumb"]
    assert robot.get_link_names("hand") == ["finger", "thumb"]
    assert robot.get_default_owner_group("elbow") == "arm"
    assert robot.get_default_owner_group("flange") == "arm" and robot.get_default_owner_group("oppose") == "hand"
    assert robot.get_default_owner_group("stand") is None


def test_parts_by_attribute(robot):
    assert isinstance(robot.arm, MoveGroupCommander) and robot.arm is robot.get_group("arm")
    assert robot.elbow.name() == "elbow" and robot.tool.name() == "tool"
    with pytest.raises(AttributeError, match="no group, joint or link 'leg'"):
        _ = robot.leg


def test_unknown_names_are_said(robot):
    for call in (robot.get_group, robot.get_joint, robot.get_link, robot.get_joint_names, robot.get_link_names,
                 robot.get_active_joint_names, robot.get_default_owner_group):
        with pytest.raises(MoveItCommanderException, match="no (group|joint|link) 'leg'"):
            call("leg")


def test_joints(robot, connection, success):
    joint = robot.get_joint("elbow")
    assert joint.variable_count() == 1
    assert joint.bounds() == [0.2, 2.6] and (joint.min_bound(), joint.max_bound()) == (0.2, 2.6)
    assert joint.value() == 1.0
    follower = robot.get_joint("oppose")
    assert follower.variable_count() == 1 and follower.bounds() == [0.0, 0.08]
    assert follower.value() == pytest.approx(2 * 0.02 + 0.01)
    fixed = robot.get_joint("flange")
    assert fixed.variable_count() == 0 and fixed.bounds() == [] and fixed.value() == []
    base = robot.get_joint("stand")
    assert base.variable_count() == 7 and base.value() == [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]
    connection.results["move_group"] = MoveGroupResult(error_code=success), ""
    assert joint.move(1.5) is True
    constraints = connection.sent[-1][1].request.goal_constraints[0].joint_constraints
    assert [(one.joint_name, one.position) for one in constraints] == [("shoulder", 0.0), ("elbow", 1.5)]
    with pytest.raises(MoveItCommanderException, match="no joint 'flange'"):
        fixed.move(0.1)
    with pytest.raises(MoveItCommanderException, match="no group has joint 'stand'"):
        base.move(0.0)


def test_state(robot, connection):
    connection.joints["shoulder"] = math.pi / 2
    connection.base = np.eye(4)
    connection.base[0, 3] = 2.0
    values = robot.get_current_variable_values()
    assert values["elbow"] == 1.0 and values["stand/trans_x"] == 2.0 and values["stand/rot_w"] == 1.0
    assert robot.get_current_state().joint_state.name == ["shoulder", "elbow", "grip", "oppose"]
    pose = robot.get_link("lower").pose()
    assert pose.header.frame_id == "world"
    assert conversions.pose_to_list(pose.pose)[:3] == pytest.approx([2.0, 0.4, 0.5])


SHAPES = """<robot name="shapes"><link name="base">
  <visual><origin xyz="0 0 1"/><geometry><box size="1 2 3"/></geometry></visual>
  <visual><geometry><sphere radius="0.5"/></geometry></visual>
  <visual><geometry><cylinder radius="0.1" length="0.4"/></geometry></visual>
  <visual><geometry><mesh filename="package://arm/a.dae" scale="1 1 2"/></geometry></visual>
</link></robot>"""


def test_markers_of_every_shape():
    model = PlanningModel.from_xml(SHAPES, "")
    markers = link_markers(model, model.state(), ["base"])
    assert [marker.type for marker in markers] == [
        Marker.CUBE, Marker.SPHERE, Marker.CYLINDER, Marker.MESH_RESOURCE]
    assert [(one.scale.x, one.scale.z) for one in markers] == [(1.0, 3.0), (1.0, 1.0), (0.2, 0.4), (1.0, 2.0)]
    assert markers[0].pose.position.z == 1.0 and markers[0].header.frame_id == "base"
    assert len({marker.id for marker in markers}) == 4


@pytest.mark.parametrize("arguments", [
    (), ({"shoulder": 1.0},), ({"shoulder": 1.0}, ["tool"]), ("hand",), ("arm", {"elbow": 0.5}), (["tool"],),
    (RobotState(joint_state=JointState(name=["elbow"], position=[0.3])),)])
def test_markers_in_every_form(robot, arguments):
    assert robot.get_robot_markers(*arguments).markers == []  # this arm has no shapes
    with pytest.raises(MoveItCommanderException, match="expected a RobotState"):
        robot.get_robot_markers(3.0)
