# SPDX-License-Identifier: BSD-3-Clause
"""Vehicles on wheels that follow commands: commands, limits, time-outs, odometry."""
import math
from pathlib import Path

import pytest
import yaml
from dynamic_reconfigure.msg import BoolParameter, Config, DoubleParameter
from dynamic_reconfigure.srv import ReconfigureRequest
from four_wheel_steering_msgs.msg import FourWheelSteering
from geometry_msgs.msg import Twist, Vector3

from controller_manager import POSITION, VELOCITY, ControllerError, ControllerTable
from controller_manager.testing import FakeHardware, fake_context
from ros_controllers.speed_limits import SpeedLimits
from ros_controllers.wheel_odometry import WheelOdometry
from urdf_model import parse_urdf

DT = 0.01
RADIUS, APART, LONG = 0.11, 0.4, 0.6
TABLE = ControllerTable(yaml.safe_load((Path(__file__).parents[2] / "config" / "controllers.yaml").read_text()))
WHEEL = """<link name="l_%(name)s"><collision><geometry><cylinder radius="0.11" length="0.05"/></geometry>
</collision></link><joint name="%(name)s" type="continuous"><parent link="base_link"/><child link="l_%(name)s"/>
<origin xyz="%(x)s %(y)s 0" rpy="-1.5708 0 0"/><axis xyz="0 0 1"/></joint>"""
ROBOT = parse_urdf('<robot name="r"><link name="base_link"/>%s</robot>' % "".join(
    WHEEL % {"name": name, "x": x, "y": y} for name, x, y in (
        ("left", 0.1, 0.2), ("right", 0.1, -0.2), ("left_2", -0.1, 0.2), ("right_2", -0.1, -0.2),
        ("rear_wheel_joint", -0.3, 0), ("front_steer_joint", 0.3, 0))))
DIFF = {"left_wheel": "left", "right_wheel": "right"}


class Vehicle:
    def __init__(self, kind, joints, parameters, robot=ROBOT):
        self.hardware = FakeHardware(joints)
        self.context, self.ros = fake_context("base", parameters, robot=robot)
        self.controller = TABLE.find(kind)("base", self.hardware, self.context)
        self.time_s = 0.0
        self.controller.starting(self.time_s)

    def drive(self, seconds, linear=None, angular=0.0):
        for _ in range(round(seconds / DT)):
            self.time_s += DT
            if linear is not None:
                self.send(linear, angular)
            self.controller.update(self.time_s, DT)
            self.hardware.step(DT)
        return self

    def send(self, linear, angular=0.0):
        self.ros.subscriptions["/robot/base/cmd_vel"].put(
            Twist(linear=Vector3(linear, 0, 0), angular=Vector3(0, 0, angular)))

    def command(self, joint, interface=VELOCITY):
        return self.hardware.command[interface][self.hardware.joint_names.index(joint)]

    @property
    def odom(self):
        return self.ros.publishers["/robot/base/odom"].messages[-1]

    @property
    def heading(self):
        turned = self.odom.pose.pose.orientation
        return 2.0 * math.atan2(turned.z, turned.w)


def diff_drive(robot=ROBOT, **parameters):
    return Vehicle("diff_drive_controller/DiffDriveController",
                   dict.fromkeys(("left", "right", "left_2", "right_2"), (VELOCITY,)), {**DIFF, **parameters}, robot)


def ackermann(**parameters):
    return Vehicle("ackermann_steering_controller/AckermannSteeringController",
                   {"rear_wheel_joint": (VELOCITY,), "front_steer_joint": (POSITION,)}, parameters)


# -- two wheels -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("linear", "angular", "left", "right"), [
    (0.5, 0.0, 0.5, 0.5), (0.0, 1.0, -0.2, 0.2), (-0.3, -0.5, -0.2, -0.4),
])
def test_wheels_turn_as_the_description_needs_it(linear, angular, left, right):
    vehicle = diff_drive().drive(0.1, linear, angular)
    assert vehicle.command("left") == pytest.approx(left / RADIUS)
    assert vehicle.command("right") == pytest.approx(right / RADIUS)


def test_odometry_of_a_straight_way_and_of_a_circle():
    vehicle = diff_drive().drive(2.0, 0.5)
    assert vehicle.odom.pose.pose.position.x == pytest.approx(1.0, abs=0.02)
    assert vehicle.odom.twist.twist.linear.x == pytest.approx(0.5)
    vehicle = diff_drive().drive(2.0 * math.pi / 0.8, 0.4, 0.8)
    assert vehicle.odom.pose.pose.position.x == pytest.approx(0.0, abs=0.02)
    assert vehicle.odom.pose.pose.position.y == pytest.approx(0.0, abs=0.02)
    assert math.remainder(vehicle.heading, 2.0 * math.pi) == pytest.approx(0.0, abs=0.02)
    assert vehicle.odom.twist.twist.angular.z == pytest.approx(0.8)


def test_an_absurd_window_of_the_mean_velocity_is_bounded():
    vehicle = diff_drive(velocity_rolling_window_size=1e300).drive(0.1, 0.5)
    assert vehicle.odom.twist.twist.linear.x > 0.0
    assert "velocity_rolling_window_size is 1e+300; 1000000 is used" in vehicle.context.log.of("warn")[0]


def test_odometry_and_transform_say_the_same():
    vehicle = diff_drive(base_frame_id="foot", odom_frame_id="/start", pose_covariance_diagonal=[1, 2, 3, 4, 5, 6])
    vehicle.drive(1.0, 0.4, 0.3)
    odom, transform = vehicle.odom, vehicle.ros.publishers["/tf"].messages[-1].transforms[0]
    assert (odom.header.frame_id, odom.child_frame_id) == ("start", "foot")
    assert (transform.header.frame_id, transform.child_frame_id) == ("start", "foot")
    assert transform.header.stamp == odom.header.stamp
    assert transform.transform.translation.x == odom.pose.pose.position.x > 0.3
    assert transform.transform.rotation == odom.pose.pose.orientation
    assert [odom.pose.covariance[7 * k] for k in range(6)] == [1, 2, 3, 4, 5, 6]
    assert sum(odom.pose.covariance) == 21


@pytest.mark.parametrize(("rate", "count"), [(None, 50), (10, 10)])
def test_odometry_comes_at_its_rate(rate, count):
    vehicle = diff_drive(**({} if rate is None else {"publish_rate": rate})).drive(1.0, 0.5)
    assert len(vehicle.ros.publishers["/robot/base/odom"].messages) == pytest.approx(count, abs=1)


def test_no_transform_where_none_is_wanted():
    assert "/tf" not in diff_drive(enable_odom_tf=False).drive(0.1, 0.5).ros.publishers


def test_an_old_command_is_a_stop():
    vehicle = diff_drive(cmd_vel_timeout=0.2).drive(0.1, 0.5).drive(0.19)
    assert vehicle.command("left") > 0.0
    vehicle.drive(0.05)
    assert vehicle.command("left") == vehicle.command("right") == 0.0


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_what_is_no_number_is_ignored_and_said(bad):
    vehicle = diff_drive().drive(0.1, 0.5)
    vehicle.send(bad)
    vehicle.drive(0.01)
    assert vehicle.command("left") == pytest.approx(0.5 / RADIUS)
    assert "not a number" in vehicle.context.log.of("warn")[0]


def test_a_start_forgets_old_commands_and_keeps_the_pose():
    vehicle = diff_drive().drive(1.0, 0.5)
    x = vehicle.odom.pose.pose.position.x
    vehicle.controller.stopping(vehicle.time_s)
    assert vehicle.command("left") == 0.0
    vehicle.send(0.5)
    vehicle.controller.starting(vehicle.time_s)
    vehicle.drive(0.1)
    assert vehicle.command("left") == 0.0
    assert vehicle.odom.pose.pose.position.x == pytest.approx(x, abs=0.02)


def reconfigure(vehicle, doubles=(), bools=()):
    config = Config(doubles=[DoubleParameter(*pair) for pair in doubles])
    config.bools = [BoolParameter(*pair) for pair in bools]
    return vehicle.ros.services["/robot/base/set_parameters"](ReconfigureRequest(config)).config


def test_sizes_rate_and_transform_change_at_run_time():
    vehicle = diff_drive(enable_odom_tf=False)
    before = reconfigure(vehicle)
    assert [(each.name, each.value) for each in before.doubles] == [
        ("left_wheel_radius_multiplier", 1.0), ("right_wheel_radius_multiplier", 1.0),
        ("wheel_separation_multiplier", 1.0), ("publish_rate", 50.0)]
    assert [(each.name, each.value) for each in before.bools] == [("enable_odom_tf", False)]
    reconfigure(vehicle, [("left_wheel_radius_multiplier", 0.8), ("wheel_separation_multiplier", 1.2),
                          ("publish_rate", 20.0)], [("enable_odom_tf", True)])
    vehicle.drive(1.0, 0.5, 0.4)
    half = 0.4 * 1.2 * APART / 2.0
    assert vehicle.command("left") == pytest.approx((0.5 - half) / (0.8 * RADIUS))
    assert vehicle.command("right") == pytest.approx((0.5 + half) / RADIUS)
    assert vehicle.odom.twist.twist.angular.z == pytest.approx(0.4, abs=1e-6)
    assert len(vehicle.ros.publishers["/tf"].messages) == pytest.approx(20, abs=1)
    reconfigure(vehicle, bools=[("enable_odom_tf", False)])
    assert "/tf" not in vehicle.ros.publishers


@pytest.mark.parametrize(("allowed", "speed"), [(True, 0.3), (False, 0.0)])
def test_commands_of_two_nodes_stop_it_where_one_is_allowed(allowed, speed):
    vehicle = diff_drive(allow_multiple_cmd_vel_publishers=allowed).drive(0.5, 0.3)
    assert vehicle.command("left") == pytest.approx(0.3 / RADIUS)
    commands, = vehicle.ros.subscriptions["/robot/base/cmd_vel"].all
    commands.senders = lambda: 2
    vehicle.drive(0.1, 0.3)
    assert vehicle.command("left") == pytest.approx(speed / RADIUS)


def test_open_loop_counts_commands():
    vehicle = diff_drive(open_loop=True)
    vehicle.hardware.frozen = True
    assert vehicle.drive(1.0, 0.5).odom.pose.pose.position.x == pytest.approx(0.5, abs=0.02)
    vehicle = diff_drive()
    vehicle.hardware.frozen = True
    assert vehicle.drive(1.0, 0.5).odom.pose.pose.position.x == 0.0


def test_several_wheels_a_side_turn_alike():
    vehicle = diff_drive(left_wheel=["left", "left_2"], right_wheel=["right", "right_2"]).drive(0.1, 0.5, 1.0)
    assert vehicle.command("left") == vehicle.command("left_2") != vehicle.command("right")
    assert vehicle.odom.twist.twist.angular.z == pytest.approx(1.0, abs=0.2)


def test_parameters_before_the_description():
    vehicle = diff_drive(wheel_radius=0.2, wheel_separation=1.0, wheel_separation_multiplier=2.0,
                         left_wheel_radius_multiplier=0.5).drive(0.1, 0.0, 1.0)
    assert vehicle.command("left") == pytest.approx(-1.0 / 0.1)
    assert vehicle.command("right") == pytest.approx(1.0 / 0.2)


def test_the_limited_command_and_the_wheels_can_be_watched():
    vehicle = diff_drive(publish_cmd=True, publish_wheel_joint_controller_state=True,
                         linear={"x": {"has_velocity_limits": True, "max_velocity": 0.3}}).drive(0.5, 9.0)
    assert vehicle.ros.publishers["/robot/base/cmd_vel_out"].messages[-1].twist.linear.x == pytest.approx(0.3)
    state = vehicle.ros.publishers["/robot/base/wheel_joint_controller_state"].messages[-1]
    assert state.joint_names == ["left", "right"]
    assert state.actual.velocities == pytest.approx([0.3 / RADIUS] * 2)


@pytest.mark.parametrize(("parameters", "text"), [
    ({"left_wheel": None}, "base/left_wheel is missing"),
    ({"left_wheel": ["left", "left_2"]}, "2 left wheels and 1 right"),
    ({"left_wheel": "front"}, "joint 'front' cannot be used"),
    ({"wheel_radius": -1.0}, "wheel_radius is -1, expected a number of m above 0"),
    ({"publish_rate": 0}, "publish_rate is 0"),
    ({"pose_covariance_diagonal": [1, 2]}, "expected six numbers"),
    ({"linear": {"x": {"has_velocity_limits": True}}}, "linear/x/max_velocity is missing"),
    ({"linear": {"x": {"has_velocity_limits": True, "max_velocity": 1, "min_velocity": 2}}}, "expected at most max"),
])
def test_wrong_parameters_are_named(parameters, text):
    with pytest.raises(ControllerError, match=text):
        diff_drive(**parameters)


def test_without_a_description_radius_and_separation_are_asked_for():
    with pytest.raises(ControllerError, match="wheel_radius is missing.*give it in m"):
        diff_drive(robot=None)
    assert diff_drive(robot=None, wheel_radius=0.1, wheel_separation=0.5).drive(0.1, 0.5).command("left") > 0.0


# -- a car ------------------------------------------------------------------------------------------------------------


def test_a_car_is_steered_by_an_angle_and_goes_in_a_circle():
    angle = 0.3
    lap_s = 2.0 * math.pi * LONG / math.tan(angle) / 0.5
    vehicle = ackermann().drive(lap_s / 2.0, 0.5, angle)
    assert vehicle.command("rear_wheel_joint") == pytest.approx(0.5 / RADIUS)
    assert vehicle.command("front_steer_joint", POSITION) == pytest.approx(angle)
    assert vehicle.odom.pose.pose.position.y == pytest.approx(2.0 * LONG / math.tan(angle), rel=0.02)
    assert vehicle.odom.twist.twist.angular.z == pytest.approx(0.5 * math.tan(angle) / LONG)
    vehicle.drive(lap_s / 2.0, 0.5, angle)
    assert math.hypot(vehicle.odom.pose.pose.position.x, vehicle.odom.pose.pose.position.y) < 0.05


def test_a_car_without_commands_stops_and_straightens():
    vehicle = ackermann().drive(0.5, 0.5, 0.3).drive(1.0)
    assert vehicle.command("rear_wheel_joint") == vehicle.command("front_steer_joint", POSITION) == 0.0


# -- cores ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("limits", "speeds"), [
    (SpeedLimits(), [9.0, 9.0]),
    (SpeedLimits(velocity=(-0.5, 1.0)), [1.0, 1.0]),
    (SpeedLimits(acceleration=(-2.0, 2.0)), [0.2, 0.4, 0.6]),
    (SpeedLimits(velocity=(-1.0, 0.3), acceleration=(-2.0, 2.0)), [0.2, 0.3, 0.3]),
    (SpeedLimits(jerk=(-10.0, 10.0)), [0.1, 0.3, 0.6]),
])
def test_speed_limits(limits, speeds):
    last = before = 0.0
    found = []
    for _ in speeds:
        before, last = last, limits.limit(9.0, last, before, 0.1)
        found.append(last)
    assert found == pytest.approx(speeds)


def test_an_arc_is_added_exactly_in_one_step_or_in_many():
    whole, parts = WheelOdometry(), WheelOdometry()
    whole.move(1.5, 2.0, 1.0)
    for _ in range(1000):
        parts.move(0.0015, 0.002, 0.001)
    assert (parts.x, parts.y, parts.heading) == pytest.approx((whole.x, whole.y, whole.heading), abs=1e-9)
    assert (whole.x, whole.y) == pytest.approx((0.75 * math.sin(2.0), 0.75 * (1.0 - math.cos(2.0))))


# -- four wheels, all of them steered ---------------------------------------------------------------------------------

_ENDS = {"%s_%s" % (end, side): (x, y) for end, x in (("front", 0.3), ("rear", -0.3))
         for side, y in (("left", 0.2), ("right", -0.2))}
STEERED = """<link name="s_%(name)s"/><joint name="steer_%(name)s" type="revolute"><parent link="base_link"/>
<child link="s_%(name)s"/><origin xyz="%(x)s %(y)s 0"/><axis xyz="0 0 1"/><limit lower="-2" upper="2" effort="9"
velocity="9"/></joint><link name="l_%(name)s"><collision><geometry><cylinder radius="0.11" length="0.05"/></geometry>
</collision></link><joint name="roll_%(name)s" type="continuous"><parent link="s_%(name)s"/><child link="l_%(name)s"/>
<origin xyz="0 %(out)s 0" rpy="-1.5708 0 0"/><axis xyz="0 0 1"/></joint>"""


def four_wheels(beside=0.05, **parameters):
    robot = parse_urdf('<robot name="r"><link name="base_link"/>%s</robot>' % "".join(
        STEERED % {"name": name, "x": x, "y": y, "out": math.copysign(beside, y)} for name, (x, y) in _ENDS.items()))
    joints = {"roll_" + name: (VELOCITY,) for name in _ENDS} | {"steer_" + name: (POSITION,) for name in _ENDS}
    lists = {"%s_%s" % (end, what): ["%s_%s_%s" % (joint, end, side) for side in ("left", "right")]
             for end in ("front", "rear") for what, joint in (("wheel", "roll"), ("steering", "steer"))}
    return Vehicle("four_wheel_steering_controller/FourWheelSteeringController", joints, {**lists, **parameters}, robot)


def test_four_wheels_look_at_the_point_that_they_turn_about():
    vehicle = four_wheels().drive(0.1, 0.5, 1.0)
    # Turning about (0, 0.5): the pivots are 0.3 m ahead or behind and 0.3 or 0.7 m beside it.
    for name, angle, way in (("front_left", math.atan2(0.3, 0.3), math.hypot(0.3, 0.3) - 0.05),
                             ("front_right", math.atan2(0.3, 0.7), math.hypot(0.3, 0.7) + 0.05),
                             ("rear_left", -math.atan2(0.3, 0.3), math.hypot(0.3, 0.3) - 0.05),
                             ("rear_right", -math.atan2(0.3, 0.7), math.hypot(0.3, 0.7) + 0.05)):
        assert vehicle.command("steer_" + name, POSITION) == pytest.approx(angle), name
        assert vehicle.command("roll_" + name) == pytest.approx(way / RADIUS), name


@pytest.mark.parametrize(("linear", "angular"), [(0.5, 0.0), (0.5, 0.8), (-0.4, 0.5), (0.6, -0.3)])
@pytest.mark.parametrize("beside", [0.0, 0.05])
def test_four_wheels_count_what_was_commanded(linear, angular, beside):
    vehicle = four_wheels(beside).drive(2.0, linear, angular)
    assert vehicle.odom.twist.twist.linear.x == pytest.approx(linear, abs=1e-6)
    assert vehicle.odom.twist.twist.angular.z == pytest.approx(angular, abs=1e-6)
    assert vehicle.heading == pytest.approx(2.0 * angular, abs=0.03)
    radius = linear / angular if angular else math.inf
    far = radius * math.sin(2.0 * angular) if angular else linear * 2.0
    assert vehicle.odom.pose.pose.position.x == pytest.approx(far, abs=0.03)


def test_four_wheels_cannot_turn_on_the_spot():
    vehicle = four_wheels().drive(0.5, 0.0, 1.0)
    assert all(vehicle.command("roll_" + name) == vehicle.command("steer_" + name, POSITION) == 0.0 for name in _ENDS)


def test_four_wheels_within_limits_and_after_the_time_out():
    limits = {"linear": {"x": {"has_velocity_limits": True, "max_velocity": 0.2}}}
    vehicle = four_wheels(**limits).drive(0.2, 1.0)
    assert vehicle.command("roll_front_left") == pytest.approx(0.2 / RADIUS)
    vehicle.drive(0.6)
    assert vehicle.command("roll_front_left") == 0.0


def test_four_wheels_want_two_joints_of_each_kind():
    with pytest.raises(ControllerError, match="front_steering is 1, expected a left and a right one"):
        four_wheels(front_steering=["steer_front_left"])


def steer(vehicle, seconds, speed, front, rear):
    for _ in range(round(seconds / DT)):
        vehicle.ros.subscriptions["/robot/base/cmd_four_wheel_steering"].put(
            FourWheelSteering(speed=speed, front_steering_angle=front, rear_steering_angle=rear))
        vehicle.drive(DT)
    return vehicle


# The cases of ros_controllers, on this vehicle: its axles are 0.6 m apart.
SYMMETRIC = math.atan(0.1 * LONG)  # radius 5 m


@pytest.mark.parametrize(("speed", "front", "rear", "x", "y", "turn"), [
    (0.2, 0.0, 0.0, 0.2, 0.0, 0.0),
    (-0.2, 0.0, 0.0, -0.2, 0.0, 0.0),
    (0.2, math.pi / 8.0, math.pi / 8.0, 0.2 * math.cos(math.pi / 8.0), 0.2 * math.sin(math.pi / 8.0), 0.0),
    (0.2, -math.pi / 2.0, -math.pi / 2.0, 0.0, -0.2, 0.0),
    (math.pi / 2.0, SYMMETRIC, -SYMMETRIC, math.pi / 2.0, 0.0, 0.2 * math.pi / 2.0),
    # tan(front) + tan(rear) is twice the slope of the middle's way, their difference the turn.
    (1.0, -math.atan(0.22), math.atan(0.16), math.cos(0.03), -math.sin(0.03), -0.38 / LONG),
])
@pytest.mark.parametrize("options", [{}, {"open_loop": True}])
def test_axles_may_be_steered_each(speed, front, rear, x, y, turn, options):
    vehicle = steer(four_wheels(**options), 2.0, speed, front, rear)
    twist = vehicle.odom.twist.twist
    assert (twist.linear.x, twist.linear.y, twist.angular.z) == pytest.approx((x, y, turn), abs=1e-3)
    assert vehicle.heading == pytest.approx(2.0 * turn, abs=0.02)
    assert math.hypot(vehicle.odom.pose.pose.position.x, vehicle.odom.pose.pose.position.y) == pytest.approx(
        abs(2.0 * speed * math.sin(turn) / turn if turn else 2.0 * speed), abs=0.04)


def test_axles_steer_at_rest_and_straighten_after_the_time_out():
    vehicle = steer(four_wheels(beside=0.0), 0.1, 0.0, 0.3, 0.3)
    assert [vehicle.command("steer_" + name, POSITION) for name in _ENDS] == pytest.approx([0.3] * 4)
    assert [vehicle.command("roll_" + name) for name in _ENDS] == [0.0] * 4
    vehicle.drive(0.6)
    assert [vehicle.command("steer_" + name, POSITION) for name in _ENDS] == [0.0] * 4


def test_the_newest_command_of_both_topics_counts():
    vehicle = steer(four_wheels(), 0.1, 0.2, 0.3, 0.3).drive(0.1, 0.4)
    assert vehicle.command("steer_front_left", POSITION) == 0.0
    assert vehicle.command("roll_front_left") == pytest.approx(0.4 / RADIUS)
    steer(vehicle, 0.1, 0.2, 0.3, 0.3)
    assert vehicle.command("steer_front_left", POSITION) == pytest.approx(0.3)
    assert vehicle.command("roll_front_left") == pytest.approx(0.2 / RADIUS)


def test_an_angle_that_is_no_number_is_ignored():
    vehicle = steer(steer(four_wheels(), 0.1, 0.2, 0.3, 0.3), 0.1, 0.2, math.nan, 0.3)
    assert vehicle.command("steer_front_left", POSITION) == pytest.approx(0.3)
