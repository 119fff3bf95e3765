# SPDX-License-Identifier: BSD-3-Clause
"""Grasps, places and postures as messages."""
import math

import numpy as np
import pytest
import rospy
from geometry_msgs.msg import Quaternion
from moveit_msgs.msg import Grasp, PlaceLocation
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from motion_planning.errors import PlanningError
from motion_planning.manipulation import PlaceTask
from motion_planning.scene import WorldObject
from moveit_ros_move_group.controllers import ControllerEntry
from moveit_ros_move_group.convert.geometry import pose_of
from moveit_ros_move_group.convert.grasps import (
    grasp_candidate,
    hand_trajectory,
    place_candidate,
    posture_of,
    usual_grasp,
)
from moveit_ros_move_group.convert.scene_in import SceneReader
from moveit_ros_move_group.handles import GripperHandle
from urdf_model import Box
from urdf_model.transforms import axis_rotation, rigid

LINK = "hand"


def posture(*values, names=("reach",), seconds=0.0, **fields):
    point = JointTrajectoryPoint(positions=list(values), time_from_start=rospy.Duration(seconds), **fields)
    return JointTrajectory(joint_names=list(names), points=[point])


def grasp(frame="world", **way):
    message = Grasp(grasp_quality=0.5)
    message.grasp_pose.header.frame_id = frame
    message.grasp_pose.pose = pose_of(rigid(axis_rotation((0.0, 0.0, 1.0), 0.4), np.array([0.3, 0.1, 0.5])))
    message.pre_grasp_approach.direction.header.frame_id = way.get("direction_frame", "world")
    message.pre_grasp_approach.direction.vector.x = way.get("x", 2.0)
    message.pre_grasp_approach.desired_distance, message.pre_grasp_approach.min_distance = 0.2, 0.1
    message.grasp_posture = posture(0.1)
    message.allowed_touch_objects = ["mat"]
    return message


def candidate(message, scene, name="it"):
    return grasp_candidate(message, name, scene, SceneReader(), LINK)


def test_a_grasp(scene):
    found = candidate(grasp(), scene)
    np.testing.assert_allclose(found.pose[:3, 3], (0.3, 0.1, 0.5))
    np.testing.assert_allclose(found.approach.vector(found.pose), (1.0, 0.0, 0.0), atol=1e-9)
    assert (found.approach.desired, found.approach.least) == pytest.approx((0.2, 0.1))
    assert (found.before, found.after, found.quality) == ({}, {"reach": 0.1}, 0.5) and found.touch == {"mat"}
    assert found.retreat.desired == 0.0, "what says nothing is no way at all"


def test_a_direction_turns_with_the_hand_in_a_frame_that_does(scene):
    found = candidate(grasp(direction_frame="hand"), scene)
    np.testing.assert_allclose(found.approach.vector(found.pose), (math.cos(0.4), math.sin(0.4), 0.0), atol=1e-9)
    # The arm's frame does not: between it and the hand is a joint.
    found = candidate(grasp(direction_frame="arm"), scene)
    np.testing.assert_allclose(found.approach.vector(found.pose), (math.cos(0.5), math.sin(0.5), 0.0), atol=1e-9)


@pytest.mark.parametrize("change, match", [
    (lambda g: setattr(g.grasp_pose.header, "frame_id", "nowhere"), "nowhere"),
    (lambda g: setattr(g.grasp_pose.pose, "orientation", Quaternion(2.0, 0.0, 0.0, 2.0)), "length 2.83"),
    (lambda g: setattr(g.pre_grasp_approach.direction.vector, "x", 0.0), "approach: 0.2 m along a direction of"),
    (lambda g: setattr(g.pre_grasp_approach.direction.vector, "x", math.nan), "finite"),
    (lambda g: setattr(g, "grasp_quality", math.inf), "quality is inf"),
    (lambda g: setattr(g, "grasp_posture", posture(0.1, names=("tail",))), "joint 'tail', unknown to robot 'crane'"),
    (lambda g: setattr(g, "grasp_posture", posture(0.1, 0.2)), "2 positions for 1 joint"),
    (lambda g: setattr(g, "grasp_posture", posture(math.nan)), "not finite")])
def test_what_cannot_be_understood(scene, change, match):
    message = grasp()
    change(message)
    with pytest.raises(PlanningError, match=match):
        candidate(message, scene)


@pytest.fixture
def holding(scene):
    cup = WorldObject("cup", scene.frame(LINK) @ rigid(np.eye(3), np.array([0.1, 0.0, 0.0])),
                      ((Box((0.05, 0.05, 0.05)), np.eye(4)),))
    return scene.with_object(cup).attach("cup", LINK, detach_posture=posture(0.4))


def test_a_place_is_where_the_object_should_be(holding):
    task = PlaceTask(holding, "arm", LINK, frozenset([LINK]), "cup")
    place = PlaceLocation()
    place.place_pose.header.frame_id = "world"
    place.place_pose.pose = pose_of(rigid(np.eye(3), np.array([0.6, 0.0, 0.5])))
    found = place_candidate(place, "it", SceneReader(), task)
    np.testing.assert_allclose(found.pose[:3, 3], (0.5, 0.0, 0.5), atol=1e-9)
    assert found.after == {"reach": 0.4}, "the hand opens as it was open before"
    place.post_place_posture = posture(0.2)
    found = place_candidate(place, "it", SceneReader(), task, of_hand=True)
    np.testing.assert_allclose(found.pose[:3, 3], (0.6, 0.0, 0.5), atol=1e-9)
    assert found.after == {"reach": 0.2}


def test_the_usual_grasp_opens_and_closes_as_far_as_it_can(model, scene):
    found = usual_grasp("cup", "world", ("reach",))
    opened = hand_trajectory(found.pre_grasp_posture, {"reach": 0.3}, model).joint_trajectory
    assert opened.points[-1].positions == [1.0]
    assert hand_trajectory(found.grasp_posture, {}, model).joint_trajectory.points[-1].positions == [0.0]
    assert posture_of(found.grasp_posture, model, "it")["reach"] < -1e300


def test_a_posture_takes_its_time_and_begins_where_the_hand_is(model):
    message = hand_trajectory(posture(0.9), {"reach": 0.1}, model).joint_trajectory
    assert [point.positions for point in message.points] == [[0.1], [0.9]]
    assert message.points[0].time_from_start == rospy.Duration()
    assert message.points[1].time_from_start >= rospy.Duration(0.8), "its limit is 1 m/s"
    timed = hand_trajectory(posture(0.9, seconds=3.0), {"reach": 0.1}, model, force=7.0).joint_trajectory
    assert timed.points[1].time_from_start == rospy.Duration(3.0)
    assert [point.effort for point in timed.points] == [[7.0], [7.0]]
    own = hand_trajectory(posture(0.9, effort=[2.0]), {"reach": 0.1}, model, force=7.0).joint_trajectory
    assert own.points[-1].effort == [2.0]


@pytest.mark.parametrize("options, expected", [({}, 0.25), ({"percent": True}, 25.0)])
def test_a_gripper_is_told_its_joint_or_percents(options, expected):
    class Handle(GripperHandle):
        def __init__(self):  # without a connection
            self.controller = ControllerEntry("grip", "GripperCommand", ("reach",), "grip/act", options=options)
            self._limits = {"reach": (0.0, 1.0)}

    goal = Handle()._goal_of(posture(0.25))
    assert goal.command.position == pytest.approx(expected)
    assert Handle()._goal_of(posture(1.5)).command.position == pytest.approx(100.0 if options else 1.5)
