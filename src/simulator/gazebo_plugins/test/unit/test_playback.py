# SPDX-License-Identifier: BSD-3-Clause
"""Joints moved through positions, a suction cup, and plugins without effect."""
import numpy as np
import pytest
import rospy
from gazebo_msgs.srv import SetJointTrajectoryRequest
from std_msgs.msg import Int32
from std_srvs.srv import EmptyRequest
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from bullet_sim import Pose
from gazebo_plugins.joint_pose_trajectory import JointPoseTrajectory
from gazebo_plugins.unserved import Nothing, Projector
from gazebo_plugins.vacuum_gripper import VacuumGripper
from urdf_model import parse_urdf

LINK = """<link name="%s"><inertial><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/>
</inertial>%s</link>"""
ARM = """<robot name="arm">%s%s%s<joint name="one" type="continuous"><parent link="base"/><child link="upper"/>
<axis xyz="0 0 1"/></joint><joint name="two" type="continuous"><parent link="upper"/><child link="lower"/>
<origin xyz="1 0 0"/><axis xyz="0 0 1"/></joint>%%s</robot>""" % tuple(LINK % (name, "") for name in
                                                                     ("base", "upper", "lower"))
CUP = '<robot name="cup"><link name="world"/>' + LINK % ("cup", "") + """<joint name="fix" type="prismatic">
<parent link="world"/><child link="cup"/><axis xyz="0 0 1"/><limit lower="-2" upper="2" effort="1000" velocity="1"/>
</joint>%s</robot>"""
BALL = '<robot name="ball">' + LINK % ("ball", "") + "</robot>"


def trajectory(points, joints=("one", "two"), frame="world"):
    message = JointTrajectory(joint_names=list(joints))
    message.header.frame_id = frame
    message.points = [JointTrajectoryPoint(positions=positions, time_from_start=rospy.Duration(lasts))
                      for positions, lasts in points]
    return message


def arm(make):
    lab = make(ARM, JointPoseTrajectory, {}, Pose((0, 0, 5)))
    lab.world.set_gravity((0, 0, 0))
    return lab


def positions(lab):
    return lab.model.read_joints()[0].tolist()


def test_points_are_taken_one_by_one_each_for_its_time(make):
    lab = arm(make)
    points = [((0.1, 0.2), 0.05), ((0.3, 0.4), 0.05), ((0.5, 0.6), 0)]
    lab.ros.subscriptions["/ns/set_joint_trajectory"].put(trajectory(points))
    assert positions(lab.run(0.04)) == pytest.approx((0.1, 0.2), abs=1e-6)
    assert positions(lab.run(0.05)) == pytest.approx((0.3, 0.4), abs=1e-6)
    assert positions(lab.run(0.05)) == pytest.approx((0.5, 0.6), abs=1e-6)


def test_the_service_does_the_same_and_says_what_is_wrong(make):
    lab = arm(make)
    serve = lab.ros.services["/ns/set_joint_trajectory"]
    request = SetJointTrajectoryRequest(model_name="arm", joint_trajectory=trajectory([((1.0, 0.0), 0)]),
                                        set_model_pose=True)
    request.model_pose.position.x, request.model_pose.orientation.w = 3.0, 1.0
    assert serve(request).success
    assert positions(lab.run(0.01)) == pytest.approx((1.0, 0.0), abs=1e-6)
    assert lab.model.base_pose().position == pytest.approx((3.0, 0.0, 0.0), abs=1e-6)
    for wrong, text in (({"model_name": "leg"}, "not 'leg'"),
                        ({"joint_trajectory": trajectory([((1.0,), 0)])}, "1 position for 2 joints"),
                        ({"joint_trajectory": trajectory([((float("nan"), 0.0), 0)])}, "point 0 is"),
                        ({"joint_trajectory": trajectory([], joints=("nose",))}, "none of the joints nose"),
                        ({"joint_trajectory": trajectory([], frame="moon")}, "frame_id is 'moon'")):
        answer = serve(SetJointTrajectoryRequest(**wrong))
        assert not answer.success and text in answer.status_message


def test_joints_that_are_not_there_are_left_out(make):
    lab = arm(make)
    lab.ros.subscriptions["/ns/set_joint_trajectory"].put(trajectory([((7.0, 0.2), 0)], joints=("nose", "two")))
    assert positions(lab.run(0.01)) == pytest.approx((0.0, 0.2), abs=1e-6)
    assert "no joints nose" in lab.log.of("warn")[0]


def test_the_link_of_the_frame_stays_where_it_is(make):
    lab = arm(make)
    before = lab.model.link_pose("lower").matrix()
    lab.ros.subscriptions["/ns/set_joint_trajectory"].put(trajectory([((0.8, -0.3), 0)], frame="arm::lower"))
    lab.run(0.002)
    np.testing.assert_allclose(lab.model.link_pose("lower").matrix(), before, atol=1e-6)
    assert lab.model.base_pose().position[1] != pytest.approx(0.0, abs=0.1)


def test_a_cup_lifts_what_is_near_and_lets_it_fall(make):
    lab = make(CUP, VacuumGripper, {"bodyName": "cup", "topicName": "grasping", "updateRate": 100}, Pose((0, 0, 1)))
    ball = lab.world.spawn(parse_urdf(BALL), "ball", Pose((0.02, 0, 0.98)))
    index = lab.model.index(["fix"])
    lab.ros.services["/ns/on"](EmptyRequest())

    def lift(speed):
        lab.model.drive_velocity(index, np.array([speed]), np.array([1000.0]))

    lab.run(1.0, lambda: lift(0.5))
    assert lab.sent("grasping")[-1].data
    assert ball.base_pose().position == pytest.approx((0, 0, 1.5), abs=0.02)
    lab.ros.services["/ns/off"](EmptyRequest())
    assert not lab.run(0.2, lambda: lift(0.0)).sent("grasping")[-1].data
    assert ball.base_pose().position[2] < 1.45


def test_a_cup_leaves_what_is_far(make):
    lab = make(CUP, VacuumGripper, {"bodyName": "cup", "topicName": "grasping"}, Pose((0, 0, 1)))
    lab.world.set_gravity((0, 0, 0))
    ball = lab.world.spawn(parse_urdf(BALL), "ball", Pose((0.06, 0, 1)))
    lab.ros.services["/ns/on"](EmptyRequest())
    assert not lab.run(0.1).sent("grasping")[-1].data
    assert ball.base_pose().position == pytest.approx((0.06, 0, 1), abs=1e-6)


def test_what_has_no_effect_is_there_and_says_so(make):
    make(BALL.replace("</robot>", "%s</robot>"), Nothing, {}).run(0.01)
    lab = make(BALL.replace("</robot>", "%s</robot>"), Projector, {"projectorTopicName": "projector"})
    assert "not drawn" in lab.log.of("warn")[0]
    lab.ros.subscriptions["/ns/projector"].put(Int32(1))
    lab.run(0.01)
