# SPDX-License-Identifier: BSD-3-Clause
"""MoveGroupCommander: targets of joints and of poses, and how they are sent to move_group."""
import math
from types import SimpleNamespace

import numpy as np
import pytest
from geometry_msgs.msg import Point, Pose, Quaternion
from moveit_msgs.msg import AttachedCollisionObject, MoveItErrorCodes, RobotState
from sensor_msgs.msg import JointState

from moveit_commander import MoveGroupCommander, MoveItCommanderException, conversions
from moveit_commander.conversions import matrix_of


def pose_stamped(frame, *values):
    return conversions.list_to_pose_stamped(values, frame)


# -- joints -------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("target", [
    [0.3, 0.7], (0.3, 0.7), np.array([0.3, 0.7]), {"shoulder": 0.3, "elbow": 0.7},
    JointState(name=["elbow", "shoulder", "grip"], position=[0.7, 0.3, 0.01]),
    RobotState(joint_state=JointState(name=["elbow", "shoulder"], position=[0.7, 0.3]))])
def test_joint_targets_in_every_form(arm, target):
    arm.set_joint_value_target(target)
    assert arm.get_joint_value_target() == [0.3, 0.7]
    goals = arm.construct_motion_plan_request().goal_constraints
    assert [(one.joint_name, one.position, one.tolerance_above, one.tolerance_below, one.weight)
            for one in goals[0].joint_constraints] == [
        ("shoulder", 0.3, 1e-4, 1e-4, 1.0), ("elbow", 0.7, 1e-4, 1e-4, 1.0)]
    assert len(goals) == 1


def test_one_joint_at_a_time_begins_at_the_default_state(arm):
    for value in (0.4, [0.4], np.float64(0.4)):
        arm.set_joint_value_target("shoulder", value)
        assert arm.get_joint_value_target() == pytest.approx([0.4, 1.4])


@pytest.mark.parametrize(("arguments", "text"), [
    (([0.1],), "has 2 joints"), (([0.1, 5.0],), "elbow = 5, limits are 0.2 to 2.6"),
    (({"toe": 0.1},), "no joint 'toe'"),
    (({"grip": 0.01},), "no joint 'grip'"), (("shoulder",), "expected one value"), (("shoulder", 9.0), "within bounds"),
    (("shoulder", [0.1, 0.2]), "expected one value"),
    (([0.1, 0.5], 1.0), "joint values alone"), (([0.1, math.nan],), "nan"),
    ((JointState(name=["toe"], position=[0.0]),), "no joint 'toe'"),
    ((JointState(name=["elbow"], position=[]),), "1 name and 0 positions"), ((Pose(), 3.0), "link's name")])
def test_bad_joint_targets_are_refused_and_change_nothing(arm, arguments, text):
    arm.set_joint_value_target([0.3, 0.7])
    with pytest.raises(MoveItCommanderException, match=text):
        arm.set_joint_value_target(*arguments)
    assert arm.get_joint_value_target() == [0.3, 0.7]


def test_a_pose_as_a_joint_target_is_solved_at_once(arm, connection, success):
    connection.answers["compute_ik"] = SimpleNamespace(error_code=success, solution=RobotState(
        joint_state=JointState(name=["grip", "elbow", "shoulder"], position=[0.0, 0.6, 0.2])))
    arm.set_joint_value_target(Pose(orientation=Quaternion(w=1.0)), "tool", True)
    assert arm.get_joint_value_target() == [0.2, 0.6]
    request = connection.called[-1][1]["ik_request"]
    assert (request.group_name, request.ik_link_name, request.pose_stamped.header.frame_id) == ("arm", "tool", "world")


def test_a_pose_out_of_reach_is_refused_or_the_nearest_is_taken(arm, connection):
    connection.answers["compute_ik"] = SimpleNamespace(error_code=MoveItErrorCodes(MoveItErrorCodes.NO_IK_SOLUTION))
    far = pose_stamped("world", 5.0, 0.0, 0.5, 0.0, 0.0, 0.0)
    with pytest.raises(MoveItCommanderException, match="NO_IK_SOLUTION"):
        arm.set_joint_value_target(far)
    arm.set_joint_value_target(far, True)
    assert arm.get_joint_value_target() == pytest.approx([0.0, 0.2], abs=0.05)


def test_named_and_remembered_targets(arm, connection):
    arm.set_named_target("ready")
    assert arm.get_joint_value_target() == [0.5, 1.0]
    arm.remember_joint_values("here")
    arm.remember_joint_values("there", [0.1, 0.9])
    assert arm.get_remembered_joint_values() == {"here": [0.0, 1.0], "there": [0.1, 0.9]}
    assert arm.get_named_targets() == ["ready", "here", "there"]
    assert arm.get_named_target_values("there") == {"shoulder": 0.1, "elbow": 0.9}
    arm.forget_joint_values("there")
    with pytest.raises(MoveItCommanderException, match="no state 'there'; it has ready, here"):
        arm.set_named_target("there")
    with pytest.raises(MoveItCommanderException, match="2 joints, got 3"):
        arm.remember_joint_values("long", [1, 2, 3])


# -- poses --------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("pose", [
    [0.1, 0.2, 0.3, 0.0, 0.0, math.pi], [0.1, 0.2, 0.3, 0.0, 0.0, 1.0, 0.0],
    Pose(Point(0.1, 0.2, 0.3), Quaternion(0.0, 0.0, 1.0, 0.0)),
    pose_stamped("base", 0.1, 0.2, 0.3, 0.0, 0.0, 1.0, 0.0)])
def test_pose_targets_in_every_form(arm, pose):
    arm.set_pose_reference_frame("base")
    arm.set_pose_target(pose)
    goal, = arm.construct_motion_plan_request().goal_constraints
    position, orientation = goal.position_constraints[0], goal.orientation_constraints[0]
    assert position.header.frame_id == orientation.header.frame_id == "base"
    assert position.link_name == orientation.link_name == "tool"
    region = position.constraint_region
    assert region.primitives[0].dimensions == [1e-4]
    assert conversions.pose_to_list(region.primitive_poses[0])[:3] == [0.1, 0.2, 0.3]
    assert orientation.orientation.z == pytest.approx(1.0)
    assert orientation.absolute_z_axis_tolerance == 1e-3
    assert position.weight == orientation.weight == 1.0


@pytest.fixture
def hand(connection):
    return MoveGroupCommander("hand")


def test_joints_that_mimic_others_have_values_too(hand):
    """The fingers of most grippers: programs write both, as they read them."""
    assert hand.get_active_joints() == ["grip"] and hand.get_joints() == ["grip", "oppose"]
    assert hand.get_variable_count() == 2
    assert hand.get_current_joint_values() == pytest.approx([0.02, 0.05])
    assert hand.get_named_target_values("open") == pytest.approx({"grip": 0.03, "oppose": 0.07})
    random = hand.get_random_joint_values()
    assert random[1] == pytest.approx(2 * random[0] + 0.01)
    hand.remember_joint_values("here")
    assert hand.get_named_target_values("here") == pytest.approx({"grip": 0.02, "oppose": 0.05})


@pytest.mark.parametrize("target", [
    [0.03, 0.07], [0.03, 0.0], [0.03], {"grip": 0.03, "oppose": 0.07}, {"grip": 0.03}, "open",
    JointState(name=["oppose", "grip"], position=[0.07, 0.03])])
def test_joints_that_mimic_others_follow_in_targets(hand, target):
    if isinstance(target, str):
        hand.set_named_target(target)
    else:
        hand.set_joint_value_target(target)
    assert hand.get_joint_value_target() == pytest.approx([0.03, 0.07])
    goal, = hand.construct_motion_plan_request().goal_constraints
    assert [(one.joint_name, one.position) for one in goal.joint_constraints] == [("grip", 0.03)]


def test_several_poses_are_alternatives_and_links_are_reached_together(arm):
    arm.set_pose_targets([[0.1, 0, 0, 0, 0, 0], [0.2, 0, 0, 0, 0, 0]])
    arm.set_pose_target([0.0, 0.0, 1.0, 0, 0, 0], "finger")
    goals = arm.construct_motion_plan_request().goal_constraints
    assert [[one.link_name for one in goal.position_constraints] for goal in goals] == [["tool", "finger"], ["tool"]]
    arm.clear_pose_target("finger")
    arm.clear_pose_target("")
    assert arm.construct_motion_plan_request().goal_constraints == []


def test_parts_of_a_pose(arm):
    arm.set_position_target([0.1, 0.2, 0.3])
    goal, = arm.construct_motion_plan_request().goal_constraints
    assert goal.orientation_constraints == [] and len(goal.position_constraints) == 1
    arm.set_rpy_target([0.0, 0.0, math.pi])
    goal, = arm.construct_motion_plan_request().goal_constraints
    assert goal.position_constraints == []
    assert goal.orientation_constraints[0].orientation.z == pytest.approx(1.0)
    arm.set_orientation_target([1.0, 0.0, 0.0, 0.0])
    assert arm.construct_motion_plan_request().goal_constraints[0].orientation_constraints[0].orientation.x == 1.0


@pytest.mark.parametrize("axis", range(6))
def test_shifting_changes_one_value(arm, connection, axis):
    before = [*conversions.pose_to_list(arm.get_current_pose().pose)[:3], *arm.get_current_rpy()]
    arm.shift_pose_target(axis, 0.05)
    goal, = arm.construct_motion_plan_request().goal_constraints
    place = goal.position_constraints[0].constraint_region.primitive_poses[0].position
    before[axis] += 0.05
    assert [place.x, place.y, place.z] == pytest.approx(before[:3])
    expected = conversions.list_to_pose(before).orientation
    turn = goal.orientation_constraints[0].orientation
    assert [turn.x, turn.y, turn.z, turn.w] == pytest.approx([expected.x, expected.y, expected.z, expected.w])


def test_bad_poses_are_refused(arm):
    for call, text in ((lambda: arm.shift_pose_target(6, 0.1), "axis from 0 to 5"),
                       (lambda: arm.set_pose_target([1, 2, 3]), "got 3 values"),
                       (lambda: arm.set_pose_targets([]), "got none"),
                       (lambda: arm.set_rpy_target([1.0]), "got 1"),
                       (lambda: arm.set_pose_target([0.0] * 6, "toe"), "no link 'toe'")):
        with pytest.raises(MoveItCommanderException, match=text):
            call()


def test_what_the_robot_holds_and_its_subframes_are_end_effector_links(arm, connection):
    """As for MoveIt: plans by message with these links work, and so do these methods."""
    held = AttachedCollisionObject(link_name="tool")
    held.object.id, held.object.pose = "pen", Pose(Point(0.0, 0.0, 0.1), Quaternion(0.0, 0.0, 0.0, 1.0))
    held.object.subframe_names = ["tip"]
    held.object.subframe_poses = [Pose(Point(0.2, 0.0, 0.0), Quaternion(0.0, 0.0, 0.0, 1.0))]
    connection.held = [held]
    tool = matrix_of(arm.get_current_pose().pose)
    for name, point in (("pen", (0.0, 0.0, 0.1, 1.0)), ("pen/tip", (0.2, 0.0, 0.1, 1.0))):
        arm.set_end_effector_link(name)
        assert arm.get_end_effector_link() == name
        assert np.allclose(matrix_of(arm.get_current_pose().pose)[:, 3], tool @ point)
        arm.clear_pose_targets()
        arm.set_pose_target([0.1, 0.2, 0.3, 0.0, 0.0, 0.0])
        arm.set_pose_target([0.1, 0.2, 0.3, 0.0, 0.0, 0.0], name)
        goal = arm.construct_motion_plan_request().goal_constraints[0]
        assert goal.position_constraints[0].link_name == name == goal.orientation_constraints[0].link_name
    for name in ("pen/cap", "pencil", "tip"):
        with pytest.raises(MoveItCommanderException, match="holds no object or subframe"):
            arm.set_pose_target([0.0] * 6, name)
