# SPDX-License-Identifier: BSD-3-Clause
"""A vehicle whose front wheel drives and steers follows its commands."""
import math

import numpy as np
import pytest
from geometry_msgs.msg import Twist, Vector3

from bullet_sim import Pose
from gazebo_plugins.tricycle import Tricycle

RADIUS, LONG, APART = 0.1, 0.5, 0.4
INERTIA = '<inertial><mass value="%s"/><inertia ixx="%s" iyy="%s" izz="%s" ixy="0" ixz="0" iyz="0"/></inertial>'
WHEEL_BODY = INERTIA % (0.5, 0.002, 0.002, 0.003) + (
    '<collision><geometry><cylinder radius="%s" length="0.04"/></geometry></collision>' % RADIUS)
WHEEL = """<link name="%(name)s_link">""" + WHEEL_BODY + """</link><joint name="%(name)s" type="continuous">
<parent link="%(parent)s"/><child link="%(name)s_link"/><origin xyz="0 %(y)s 0" rpy="-1.5708 0 0"/><axis xyz="0 0 1"/>
</joint>"""
URDF = '<robot name="r"><link name="base">%s</link><link name="fork">%s</link>%s%%s</robot>' % (
    '<inertial><origin xyz="0.2 0 0"/><mass value="8"/><inertia ixx="0.1" iyy="0.1" izz="0.15"/></inertial>',
    INERTIA % (0.5, 0.002, 0.002, 0.002),
    '<joint name="front_steering_joint" type="revolute"><parent link="base"/><child link="fork"/><origin xyz="%s 0 0"/>'
    '<axis xyz="0 0 1"/><limit lower="-1.6" upper="1.6" effort="50" velocity="10"/></joint>' % LONG
    + "".join(WHEEL % {"name": name, "parent": parent, "y": y} for name, parent, y in (
        ("front_wheel_joint", "fork", 0.0), ("left_wheel_joint", "base", APART / 2), ("right_wheel_joint", "base",
                                                                                       -APART / 2))))
SIZES = {"actuatedWheelDiameter": 2 * RADIUS, "encoderWheelDiameter": 2 * RADIUS, "encoderWheelSeparation": APART,
         "wheelTorque": 20}


@pytest.fixture
def tricycle(make):
    return lambda **elements: make(URDF, Tricycle, {**SIZES, **elements}, Pose((0, 0, RADIUS)))


def command(lab, speed, angle):
    lab.ros.subscriptions["/ns/cmd_vel"].put(Twist(Vector3(speed, 0, 0), Vector3(0, 0, angle)))
    return lab


def heading(pose):
    return 2.0 * math.atan2(pose.orientation.z, pose.orientation.w)


@pytest.mark.parametrize("angle", [0.4, -0.4])
@pytest.mark.parametrize("exchanged", [False, True])
def test_it_turns_as_its_front_wheel_points_and_the_wheels_count_that(tricycle, angle, exchanged):
    names = ["left_wheel_joint", "right_wheel_joint"]
    left, right = names[::-1] if exchanged else names
    lab = tricycle(odometrySource="encoder", encoderWheelLeftJoint=left, encoderWheelRightJoint=right)
    command(lab, 0.4, angle).run(1.0)
    before = lab.model.base_pose().matrix()
    lab.run(3.0)
    after = lab.model.base_pose().matrix()
    turned = math.atan2(*(before[:3, :3].T @ after[:3, :3])[1::-1, 0])
    # About the point where the axes of the wheels meet.
    assert turned == pytest.approx(3.0 * 0.4 * math.sin(angle) / LONG, rel=0.05)
    odom = lab.sent("odom")[-1]
    assert odom.child_frame_id == "base_link"
    true = math.atan2(after[1, 0], after[0, 0])
    assert math.remainder(heading(odom.pose.pose) - true, 2.0 * math.pi) == pytest.approx(0.0, abs=0.08)
    place = odom.pose.pose.position
    assert np.hypot(*(after[:2, 3] - (place.x, place.y))) < 0.05


def test_wheel_and_steering_take_their_time(tricycle):
    lab = tricycle(steeringSpeed=0.4, wheelAcceleration=2.0, wheelDeceleration=8.0)
    steering, wheel = lab.model.index(["front_steering_joint", "front_wheel_joint"])
    command(lab, 0.4, 0.6).run(0.5)
    position, velocity, _ = lab.model.read_joints()
    assert position[steering] == pytest.approx(0.2, abs=0.02)
    assert velocity[wheel] == pytest.approx(1.0, abs=0.1)
    command(lab, 0.0, 0.6).run(0.2)
    assert lab.model.read_joints()[1][wheel] == pytest.approx(0.0, abs=0.05)


def test_the_state_of_all_four_joints(tricycle):
    lab = command(tricycle(publishWheelJointState="true"), 0.4, 2.0).run(1.0)
    state = lab.sent("joint_states")[-1]
    assert state.name == ["front_steering_joint", "front_wheel_joint", "left_wheel_joint", "right_wheel_joint"]
    assert state.position[0] == pytest.approx(math.pi / 2.0, abs=0.02), "at most a quarter turn"
    assert state.velocity[1] == pytest.approx(0.4 / RADIUS, abs=0.2)
