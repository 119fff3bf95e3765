# SPDX-License-Identifier: BSD-3-Clause
"""Vehicles on a floor follow their commands and publish their odometry."""
import math

import numpy as np
import pytest
from geometry_msgs.msg import Twist, Vector3
from std_msgs.msg import Empty

from bullet_sim import Pose, World
from gazebo_plugins.drives import DiffDrive, ForceBasedMove, PlanarMove, SkidSteer
from gazebo_plugins.kobuki import Kobuki
from gazebo_ros.model_plugin import PluginContext, PluginError, PluginSource
from gazebo_ros.urdf_extras import plugins
from loop_ros.testing import FakeLog, FakeRos
from urdf_model import parse_urdf

DT = 0.002
INERTIA = '<inertial><mass value="%s"/><inertia ixx="%s" iyy="%s" izz="%s" ixy="0" ixz="0" iyz="0"/></inertial>'
COLLISION = "<collision><geometry><%s/></geometry></collision>"
BODY = '<link name="base">%s%s</link>' % (INERTIA % (5, 0.05, 0.05, 0.08), COLLISION % 'box size="0.3 0.3 0.1"')
SMOOTH_BODY = BODY + '<gazebo reference="base"><mu1>0.0</mu1><mu2>0.0</mu2></gazebo>'
CASTER = """<link name="caster">%s%s</link><joint name="caster" type="fixed"><parent link="base"/><child link="caster"/>
<origin xyz="-0.12 0 -0.05"/></joint><gazebo reference="caster"><mu1>0.0</mu1><mu2>0.0</mu2></gazebo>""" % (
    INERTIA % (0.1, 1e-4, 1e-4, 1e-4), COLLISION % 'sphere radius="0.05"')
WHEEL = """<link name="%(name)s_link">%(body)s</link><joint name="%(name)s" type="continuous"><parent link="base"/>
<child link="%(name)s_link"/><origin xyz="%(x)s %(y)s 0" rpy="-1.5708 0 0"/><axis xyz="0 0 1"/></joint>"""
TWO = {"left": (0.05, 0.18), "right": (0.05, -0.18)}
FOUR = {"%s_%s_joint" % (side, end): (x, y) for side, y in (("left", 0.18), ("right", -0.18))
        for end, x in (("front", 0.15), ("rear", -0.15))}
DIFF = {"leftJoint": "left", "rightJoint": "right", "wheelSeparation": 0.36, "wheelDiameter": 0.2, "wheelTorque": 10}


def urdf(wheels, elements, caster=True):
    inside = "".join("<%s>%s</%s>" % (tag, text, tag) for tag, text in elements.items() if text is not None)
    body = INERTIA % (0.5, 0.002, 0.002, 0.003) + COLLISION % 'cylinder radius="0.1" length="0.04"'
    return '<robot name="r">%s%s%s<gazebo><plugin name="p" filename="x.so">%s</plugin></gazebo></robot>' % (
        BODY if wheels else SMOOTH_BODY, CASTER if caster else "",
        "".join(WHEEL % {"name": name, "x": x, "y": y, "body": body} for name, (x, y) in wheels.items()), inside)


class Vehicle:
    def __init__(self, plugin_class, wheels, elements, caster=True):
        self.world = World(time_step_s=DT)
        self.world.add_ground_plane()
        text = urdf(wheels, elements, caster)
        robot = parse_urdf(text)
        self.model = self.world.spawn(robot, "r", Pose((0, 0, 0.1 if wheels else 0.5)))
        self.ros, self.log = FakeRos(), FakeLog()
        source = PluginSource(robot, plugins(robot)[0], "/ns", text)
        context = PluginContext(self.world, self.model, source, self.log, self.ros, {})
        self.plugin = plugin_class(context)

    def command(self, x=0.0, turn=0.0, y=0.0, topic="/ns/cmd_vel"):
        self.ros.subscriptions[topic].put(Twist(Vector3(x, y, 0), Vector3(0, 0, turn)))

    def run(self, seconds):
        for _ in range(round(seconds / DT)):
            self.plugin.update(self.world.time_s, DT)
            self.world.step()
            self.plugin.publish(self.world.time_s)
        return self

    def true_pose(self):
        pose = self.model.base_pose().matrix()
        return np.array([pose[0, 3], pose[1, 3], math.atan2(pose[1, 0], pose[0, 0])])

    @property
    def odom(self):
        return self.ros.publishers["/ns/odom"].messages[-1]

    def counted_pose(self):
        pose = self.odom.pose.pose
        return np.array([pose.position.x, pose.position.y, 2.0 * math.atan2(pose.orientation.z, pose.orientation.w)])


@pytest.fixture
def make():
    made = []

    def make_one(*arguments, **options):
        made.append(Vehicle(*arguments, **options))
        return made[-1]

    yield make_one
    for each in made:
        each.world.close()


def two_wheeler(make, **elements):
    return make(DiffDrive, TWO, {**DIFF, **elements})


@pytest.mark.parametrize("source", ["world", "encoder"])
def test_two_wheels_drive_a_square_and_the_odometry_is_true(make, source):
    vehicle, way = two_wheeler(make, odometrySource=source, wheelAcceleration=1.0), 0.0
    for _ in range(4):
        for x, turn, seconds in ((0.5, 0.0, 2.0), (0.0, 0.0, 1.0), (0.0, 0.8, math.pi / 2 / 0.8), (0.0, 0.0, 1.0)):
            vehicle.command(x, turn)
            vehicle.run(seconds)
            way += x * seconds
    true, counted = vehicle.true_pose(), vehicle.counted_pose()
    assert np.hypot(*(true - counted)[:2]) < 0.02 * way
    assert abs(math.remainder(true[2] - counted[2], 2.0 * math.pi)) < 0.02 * 2.0 * math.pi


def test_the_last_command_counts_until_the_next_one(make):
    vehicle = two_wheeler(make)
    vehicle.command(0.4)
    assert vehicle.run(3.0).true_pose()[0] == pytest.approx(1.2, abs=0.1)
    assert vehicle.odom.twist.twist.linear.x == pytest.approx(0.4, abs=0.02)
    vehicle.command(math.nan)
    assert vehicle.run(0.5).true_pose()[0] == pytest.approx(1.4, abs=0.1)
    assert "not a number" in vehicle.log.of("warn")[0]
    vehicle.command(0.0)
    x = vehicle.run(0.5).true_pose()[0]
    assert vehicle.run(1.0).true_pose()[0] == pytest.approx(x, abs=0.01)


@pytest.mark.parametrize("legacy", ["false", "true", None])
def test_left_is_left_whatever_legacy_mode_says(make, legacy):
    """The plugin of kinetic exchanged the sides; that of melodic and noetic does not (gazebo_plugins 2.8.3)."""
    vehicle = two_wheeler(make, legacyMode=legacy)
    assert vehicle.log.of("warn") == []
    vehicle.command(0.0, 0.5)
    assert vehicle.run(1.0).true_pose()[2] == pytest.approx(0.5, abs=0.1)


def test_odometry_transform_and_wheels_come_at_their_rate(make):
    vehicle = two_wheeler(make, updateRate=20, publishWheelJointState="true", robotBaseFrame="base_footprint")
    vehicle.command(0.3)
    vehicle.run(1.0)
    for topic in ("/ns/odom", "/tf", "/ns/joint_states"):
        assert len(vehicle.ros.publishers[topic].messages) == pytest.approx(20, abs=1), topic
    transform = vehicle.ros.publishers["/tf"].messages[-1].transforms[0]
    assert (transform.header.frame_id, transform.child_frame_id) == ("odom", "base_footprint")
    assert transform.transform.translation == vehicle.odom.pose.pose.position or (
        transform.transform.translation.x == vehicle.odom.pose.pose.position.x > 0.2)
    wheels = vehicle.ros.publishers["/ns/joint_states"].messages[-1]
    assert wheels.name == ["left", "right"] and wheels.velocity == pytest.approx([3.0, 3.0], abs=0.1)


def test_without_the_transform(make):
    assert "/tf" not in two_wheeler(make, publishOdomTF="false").ros.publishers
    assert not {"/tf", "/ns/odom"} & set(two_wheeler(make, publishTf="false").run(DT).ros.publishers)


def test_the_frames_of_the_wheels(make):
    vehicle = two_wheeler(make, publishWheelTF="true", publishOdomTF="false")
    vehicle.run(0.05)
    left, right = vehicle.ros.publishers["/tf"].messages[-1].transforms
    assert [(each.header.frame_id, each.child_frame_id) for each in (left, right)] == [
        ("base", "left_link"), ("base", "right_link")]
    assert (left.transform.translation.x, left.transform.translation.y) == pytest.approx(TWO["left"], abs=1e-3)


def test_after_a_reset_it_stands_until_told_otherwise(make):
    vehicle = two_wheeler(make)
    vehicle.command(0.5)
    vehicle.run(1.0)
    vehicle.world.reset_models()
    vehicle.plugin.reset()
    vehicle.run(1.0)
    assert np.abs(vehicle.true_pose()).max() < 0.02


@pytest.mark.parametrize(("elements", "text"), [
    ({"leftJoint": "nose"}, "<leftJoint> is 'nose', expected one of the joints left, right"),
    ({"wheelDiameter": "0"}, "<wheelDiameter> is 0"), ({"wheelSeparation": "wide"}, "<wheelSeparation> is 'wide'"),
    ({"odometrySource": "stars"}, "expected world or encoder"),
    ({"updateRate": "-5"}, "<updateRate> is '-5'"),
])
def test_wrong_elements_are_named(elements, text):
    with pytest.raises(PluginError, match=text):
        two_wheeler(Vehicle, **elements).world.close()


def test_four_wheels_go_straight_and_turn(make):
    vehicle = make(SkidSteer, FOUR, {"wheelSeparation": 0.36, "wheelDiameter": 0.2, "torque": 20}, caster=False)
    vehicle.command(0.5)
    x, y, heading = vehicle.run(2.0).true_pose()
    assert x == pytest.approx(1.0, abs=0.1) and abs(y) < 0.05 and abs(heading) < 0.05
    assert vehicle.counted_pose() == pytest.approx((x, y, heading), abs=0.02)
    vehicle.command(0.0, 1.0)
    # Four wheels have to slip to turn, so it turns by less than it was told.
    assert vehicle.run(2.0).true_pose()[2] > 0.3


def test_planar_move_slides_as_commanded(make):
    vehicle = make(PlanarMove, {}, {}, caster=False)
    height = vehicle.model.base_pose().position[2]
    vehicle.command(0.3, y=0.2)
    x, y, _ = vehicle.run(1.0).true_pose()
    assert (x, y) == pytest.approx((0.3, 0.2), abs=0.01)
    assert vehicle.model.base_pose().position[2] == pytest.approx(height, abs=0.03)
    vehicle.command(0.0, 0.5)
    assert vehicle.run(1.0).true_pose()[2] == pytest.approx(0.5, abs=0.02)
    assert len(vehicle.ros.publishers["/ns/odom"].messages) == pytest.approx(40, abs=2)


@pytest.mark.parametrize(("timeout", "moved"), [(0.2, 0.1), (-1, 0.5), (None, 0.5)])
def test_planar_move_stops_when_commands_do(make, timeout, moved):
    vehicle = make(PlanarMove, {}, {"cmdTimeout": timeout}, caster=False)
    vehicle.command(0.5)
    assert vehicle.run(1.0).true_pose()[0] == pytest.approx(moved, abs=0.01)


def test_force_based_move_moves_as_commanded_and_falls(make):
    vehicle = make(ForceBasedMove, {}, {}, caster=False)
    vehicle.command(0.3, y=0.2)
    x, y, _ = vehicle.run(1.0).true_pose()
    assert (x, y) == pytest.approx((0.3, 0.2), abs=0.01)
    assert vehicle.model.base_pose().position[2] == pytest.approx(0.05, abs=0.01)
    vehicle.command(0.0, 0.5)
    assert vehicle.run(1.0).true_pose()[2] == pytest.approx(0.5, abs=0.02)


VELOCITY = "/ns/mobile_base/commands/velocity"
KOBUKI = {"left_wheel_joint_name": "left", "right_wheel_joint_name": "right", "wheel_separation": 0.36,
          "wheel_diameter": 0.2, "torque": 1, "velocity_command_timeout": 0.6}


def test_kobuki_drives_and_its_odometry_is_true(make):
    vehicle = make(Kobuki, TWO, KOBUKI)
    for x, turn in ((0.3, 0.0), (0.2, 0.8), (0.0, 0.8)):
        for _ in range(10):
            vehicle.command(x, turn, topic=VELOCITY)
            vehicle.run(0.2)
    x, y, heading = vehicle.true_pose()
    assert math.remainder(heading - 3.2, math.tau) == pytest.approx(0.0, abs=0.2)
    # The axle, of which odometry tells, is 5 cm ahead of the base.
    axle = x + 0.05 * (math.cos(heading) - 1.0), y + 0.05 * math.sin(heading)
    counted = vehicle.counted_pose()
    assert counted[:2] == pytest.approx(axle, abs=0.05)
    assert math.remainder(counted[2] - heading, math.tau) == pytest.approx(0.0, abs=0.03)
    imu = vehicle.ros.publishers["/ns/mobile_base/sensors/imu_data"].messages[-1]
    assert imu.angular_velocity.z == pytest.approx(0.8, abs=0.05)
    assert imu.linear_acceleration.z == pytest.approx(9.8, abs=0.5)
    assert vehicle.ros.publishers["/ns/joint_states"].messages[-1].name == ["left", "right"]
    assert "/tf" not in vehicle.ros.publishers and "kobuki_msgs" in vehicle.log.of("warn")[0]


def test_kobuki_stops_when_commands_end_and_forgets_its_way_when_told(make):
    vehicle = make(Kobuki, TWO, KOBUKI)
    vehicle.command(0.3, topic=VELOCITY)
    x = vehicle.run(1.0).true_pose()[0]
    assert 0.1 < x < 0.25
    assert vehicle.run(1.0).true_pose()[0] == pytest.approx(x, abs=0.01)
    vehicle.ros.subscriptions["/ns/mobile_base/commands/reset_odometry"].put(Empty())
    assert np.abs(vehicle.run(0.1).counted_pose()).max() < 0.01
