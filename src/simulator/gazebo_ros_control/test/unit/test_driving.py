# SPDX-License-Identifier: BSD-3-Clause
"""A vehicle on two driven wheels and a caster on the floor: its pose agrees with its controller's odometry."""
import math

import numpy as np
import pytest
from geometry_msgs.msg import Twist, Vector3

from bullet_sim import Pose, World
from controller_manager.testing import fake_context
from gazebo_ros_control.hardware import SimulatedHardware
from loop_ros.testing import FakeLog
from ros_controllers.diff_drive import DiffDriveController
from urdf_model import parse_urdf

DT = 0.002
INERTIA = '<inertial><mass value="%s"/><inertia ixx="%s" iyy="%s" izz="%s" ixy="0" ixz="0" iyz="0"/></inertial>'
COLLISION = "<collision><geometry><%s/></geometry></collision>"
BODY = """<link name="base_link">%s%s</link><link name="caster">%s%s</link>
<joint name="caster" type="fixed"><parent link="base_link"/><child link="caster"/><origin xyz="-0.12 0 -0.05"/></joint>
<gazebo reference="caster"><mu1>0.0</mu1><mu2>0.0</mu2></gazebo>""" % (
    INERTIA % (5.0, 0.05, 0.05, 0.08), COLLISION % 'box size="0.3 0.3 0.1"',
    INERTIA % (0.1, 1e-4, 1e-4, 1e-4), COLLISION % 'sphere radius="0.05"')
WHEEL = """<link name="%(side)s_wheel">%(inertial)s%(collision)s</link>
<joint name="%(side)s" type="continuous"><parent link="base_link"/><child link="%(side)s_wheel"/>
<origin xyz="0.05 %(y)s 0" rpy="-1.5708 0 0"/><axis xyz="0 0 1"/></joint>
<transmission name="t_%(side)s"><type>transmission_interface/SimpleTransmission</type><joint name="%(side)s">
<hardwareInterface>hardware_interface/VelocityJointInterface</hardwareInterface></joint><actuator name="m"/>
</transmission>"""
URDF = '<robot name="r">%s%s</robot>' % (BODY, "".join(
    WHEEL % {"side": side, "y": y, "inertial": INERTIA % (0.5, 0.002, 0.002, 0.003),
             "collision": COLLISION % 'cylinder radius="0.1" length="0.04"'}
    for side, y in (("left", 0.18), ("right", -0.18))))


class Vehicle:
    def __init__(self, world):
        robot = parse_urdf(URDF)
        self.world = world
        self.world.add_ground_plane()
        self.model = self.world.spawn(robot, "r", Pose((0, 0, 0.1)))
        self.hardware = SimulatedHardware(self.model, robot, URDF, log=FakeLog())
        context, self.ros = fake_context("base", {
            "left_wheel": "left", "right_wheel": "right",
            **{axis: {kind: {"has_acceleration_limits": True, "max_acceleration": bound}}
               for axis, kind, bound in (("linear", "x", 1.0), ("angular", "z", 2.0))}}, robot=robot)
        self.controller = DiffDriveController("base", self.hardware, context)
        self.controller.starting(0.0)

    def drive(self, seconds, linear=0.0, angular=0.0):
        for _ in range(round(seconds / DT)):
            self.hardware.read()
            self.ros.subscriptions["/robot/base/cmd_vel"].put(Twist(Vector3(linear, 0, 0), Vector3(0, 0, angular)))
            self.controller.update(self.world.time_s, DT)
            self.hardware.write(DT)
            self.world.step()

    def true_pose(self):
        """x, y [m] and heading [rad] in the world."""
        pose = self.model.base_pose().matrix()
        return pose[0, 3], pose[1, 3], math.atan2(pose[1, 0], pose[0, 0])

    def odometry(self):
        message = self.ros.publishers["/robot/base/odom"].messages[-1]
        turned = message.pose.pose.orientation
        return (message.pose.pose.position.x, message.pose.pose.position.y, 2.0 * math.atan2(turned.z, turned.w))


@pytest.fixture
def vehicle():
    world = World(time_step_s=DT)
    yield Vehicle(world)
    world.close()


def test_it_drives_after_a_long_rest(vehicle):
    vehicle.drive(8.0)
    vehicle.drive(2.0, linear=0.5)
    assert vehicle.true_pose()[0] > 0.7


def test_odometry_after_a_square_is_true_within_two_percent(vehicle):
    way = 0.0
    for _ in range(4):
        vehicle.drive(2.5, linear=0.5)
        vehicle.drive(1.0)
        vehicle.drive(math.pi / 2.0 / 0.8, angular=0.8)
        vehicle.drive(1.0)
        way += 1.25
    true, counted = vehicle.true_pose(), vehicle.odometry()
    assert np.hypot(true[0] - counted[0], true[1] - counted[1]) < 0.02 * way
    # The wheels slip sideways in turns, as on a real vehicle.
    assert abs(math.remainder(true[2] - counted[2], 2.0 * math.pi)) < 0.02 * 2.0 * math.pi
    assert np.hypot(*true[:2]) < 0.3
