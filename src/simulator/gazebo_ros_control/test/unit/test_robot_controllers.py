# SPDX-License-Identifier: BSD-3-Clause
"""libfetch_gazebo_plugin.so on a small robot with a torso, an arm, a gripper and wheels, without a master."""
import math
from xml.etree import ElementTree

import numpy as np
import pytest
from actionlib_msgs.msg import GoalID, GoalStatus
from control_msgs.msg import (
    FollowJointTrajectoryActionGoal,
    FollowJointTrajectoryGoal,
    GripperCommand,
    GripperCommandActionGoal,
    GripperCommandGoal,
    PointHeadActionGoal,
    PointHeadGoal,
)
from geometry_msgs.msg import Quaternion, Transform, TransformStamped, Twist, Vector3
from rospy import Duration, Time
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from bullet_sim import Pose, World
from gazebo_ros.model_plugin import PluginContext, PluginSource
from gazebo_ros_control.cascade import GRAVITY_M_S2, CarriedChain
from gazebo_ros_control.robot_controllers import RobotControllers
from lab_testing.closing import factory
from loop_ros.testing import FakeLog, FakeRos
from urdf_model import parse_urdf

DT = 0.001
ARM_M, ARM_KG = 0.2, 1.5
LINK = """<link name="%s"><inertial><mass value="%g"/><origin xyz="%g 0 0"/>
  <inertia ixx="0.02" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
JOINT = """<joint name="%s" type="%s"><parent link="%s"/><child link="%s"/><origin xyz="%s"/><axis xyz="%s"/>
  <limit lower="%g" upper="%g" velocity="%g" effort="%g"/></joint>"""
URDF = "<robot name='fetch'><link name='world'/>" + "".join(LINK % row for row in (
    ("base_link", 20, 0), ("torso", 5, 0), ("arm", ARM_KG, ARM_M), ("left", 0.1, 0), ("right", 0.1, 0),
    ("l_wheel", 1, 0), ("r_wheel", 1, 0), ("pan", 2, 0), ("head", 2, 0.05))) + "".join(JOINT % row for row in (
        ("fixed", "fixed", "world", "base_link", "0 0 1", "0 0 1", 0, 0, 1, 1),
        ("torso_joint", "prismatic", "base_link", "torso", "0 0 0.3", "0 0 1", 0, 0.4, 0.5, 450),
        ("arm_joint", "revolute", "torso", "arm", "0.1 0 0.1", "0 1 0", -1.5, 1.5, 2, 30),
        ("l_gripper_finger_joint", "prismatic", "arm", "left", "0.4 0.02 0", "0 1 0", 0, 0.05, 0.05, 60),
        ("r_gripper_finger_joint", "prismatic", "arm", "right", "0.4 -0.02 0", "0 -1 0", 0, 0.05, 0.05, 60),
        ("l_wheel_joint", "continuous", "base_link", "l_wheel", "0 0.19 0", "0 1 0", 0, 0, 17, 9),
        ("r_wheel_joint", "continuous", "base_link", "r_wheel", "0 -0.19 0", "0 1 0", 0, 0, 17, 9),
        ("head_pan_joint", "revolute", "torso", "pan", "0.05 0 0.6", "0 0 1", -1.57, 1.57, 1.5, 10),
        ("head_tilt_joint", "revolute", "pan", "head", "0.14 0 0.06", "0 1 0", -0.76, 1.45, 1.5, 50))) + "</robot>"
HEAD = "head_pan_joint", "head_tilt_joint"
FOLLOW = "robot_controllers/FollowJointTrajectoryController"
CONTROLLERS = {
    "arm_controller": {
        "follow_joint_trajectory": {"type": FOLLOW, "joints": ["arm_joint"]},
        "gravity_compensation": {"type": "robot_controllers/GravityCompensation", "root": "torso", "tip": "arm",
                                 "autostart": True}},
    "both_controller": {"follow_joint_trajectory": {"type": FOLLOW, "joints": ["torso_joint", "arm_joint"]}},
    "gripper_controller": {"gripper_action": {"type": "robot_controllers/ParallelGripperController",
                                              "centering": {"p": 1000.0}}},
    "base_controller": {"type": "robot_controllers/DiffDriveBaseController", "autostart": True},
    "head_controller": {"point_head": {"type": "robot_controllers/PointHeadController"},
                        "follow_joint_trajectory": {"type": FOLLOW, "joints": list(HEAD)}},
}
NAMES = ["arm_controller/follow_joint_trajectory", "arm_controller/gravity_compensation",
         "both_controller/follow_joint_trajectory", "gripper_controller/gripper_action", "base_controller",
         "head_controller/point_head", "head_controller/follow_joint_trajectory"]
ARM, _, BOTH, GRIPPER, BASE, POINT, PAN_TILT = ["/" + name for name in NAMES]


class Robot:
    """The robot in a world; ``names``: the controllers that the parameter server lists."""

    def __init__(self, names=tuple(NAMES), controllers=None):
        self.world = World(time_step_s=DT)
        description = parse_urdf(URDF)
        self.model = self.world.spawn(description, "fetch", Pose((0, 0, 0)))
        self.log, self.ros = FakeLog(), FakeRos()
        gains = {joint: {"position": {"p": 100.0}} for joint in self.model.joint_names}
        tree = {"gazebo": {"default_controllers": list(names), **gains}, **(controllers or CONTROLLERS)}
        context = PluginContext(self.world, self.model, PluginSource(
            description, ElementTree.fromstring("<plugin/>"), "", URDF), self.log, self.ros, tree)
        self.plugin = RobotControllers(context)
        self._goals = 0

    def run(self, seconds):
        for _ in range(round(seconds / DT)):
            self.plugin.update(self.world.time_s, DT)
            self.world.step()

    def at(self, *joints):
        return self.model.read_joints()[0][self.model.index(joints)]

    def move(self, action, joints, positions, seconds):
        point = JointTrajectoryPoint(positions=positions, velocities=[0.0] * len(joints),
                                     time_from_start=Duration.from_sec(seconds))
        goal = FollowJointTrajectoryGoal(trajectory=JointTrajectory(joint_names=joints, points=[point]))
        return self._send(action, FollowJointTrajectoryActionGoal, goal)

    def grip(self, position, effort):
        goal = GripperCommandGoal(GripperCommand(position, effort))
        return self._send(GRIPPER, GripperCommandActionGoal, goal)

    def look(self, frame, point, seconds=0.0, max_velocity=0.0):
        goal = PointHeadGoal(min_duration=Duration.from_sec(seconds), max_velocity=max_velocity)
        goal.target.header.frame_id = frame
        goal.target.point.x, goal.target.point.y, goal.target.point.z = point
        return self._send(POINT, PointHeadActionGoal, goal)

    def off_sight(self, point):
        """The angle between x of the head and the way to ``point`` (3,) in the world [rad]."""
        pose = self.model.link_pose("head").matrix()
        way = np.subtract(point, pose[:3, 3])
        return math.acos(min(1.0, pose[:3, 0] @ way / np.linalg.norm(way)))

    def result(self, action, goal):
        """(state, result) of a goal that has ended."""
        for message in self.ros.publishers[action + "/result"].messages:
            if message.status.goal_id.id == goal:
                return message.status.status, message.result
        raise AssertionError("%s has not ended" % goal)

    def _send(self, action, action_goal, goal):
        self._goals += 1
        message = action_goal(goal=goal)
        message.goal_id.id = "goal %d" % self._goals
        self.ros.subscriptions[action + "/goal"].put(message)
        return message.goal_id.id


@pytest.fixture
def make_robot():
    with factory(Robot, "plugin", "world") as made:
        yield made


@pytest.fixture
def robot(make_robot):
    return make_robot()


def test_an_arm_without_a_goal_is_carried_and_one_without_compensation_falls(make_robot):
    carried = make_robot()
    carried.run(0.3)
    # The fingers, beside the chain, pull it down.
    torque = 2 * 0.1 * GRAVITY_M_S2 * 0.4
    falls = 0.5 * torque / (3 * 0.02 + ARM_KG * ARM_M ** 2 + 2 * 0.1 * 0.4 ** 2) * 0.3 ** 2
    assert carried.at("arm_joint")[0] == pytest.approx(falls, rel=0.05)
    dropped = make_robot(NAMES[:1])
    dropped.run(0.3)
    assert dropped.at("arm_joint")[0] > 3.0 * falls


def test_goals_move_joints_and_the_joints_stay(robot):
    goal = robot.move(ARM, ["arm_joint"], [-0.5], 0.5)
    robot.run(0.7)
    state, result = robot.result(ARM, goal)
    assert (state, result.error_code) == (GoalStatus.SUCCEEDED, 0)
    robot.run(0.5)
    assert robot.at("arm_joint")[0] == pytest.approx(-0.5, abs=1e-3)
    goal = robot.move(BOTH, ["torso_joint", "arm_joint"], [0.1, 0.2], 0.5)
    robot.run(0.7)
    assert robot.result(BOTH, goal)[0] == GoalStatus.SUCCEEDED
    assert robot.at("torso_joint", "arm_joint") == pytest.approx([0.1, 0.2], abs=1e-3)
    # The arm alone again: the torso, which no controller has, sinks to its stop, as the plugin for Gazebo lets it.
    robot.move(ARM, ["arm_joint"], [0.0], 0.3)
    robot.run(1.0)
    assert robot.at("torso_joint", "arm_joint") == pytest.approx([0.0, 0.0], abs=2e-3)


def test_a_goal_that_shares_joints_with_a_moving_controller_is_rejected(robot):
    first = robot.move(BOTH, ["torso_joint", "arm_joint"], [0.1, -0.4], 0.6)
    robot.run(0.2)
    second = robot.move(ARM, ["arm_joint"], [0.3], 0.5)
    robot.run(0.6)
    assert robot.result(ARM, second)[0] == GoalStatus.REJECTED
    assert "has a goal and shares joints arm_joint" in robot.log.of("error")[0]
    assert robot.result(BOTH, first)[0] == GoalStatus.SUCCEEDED


def test_the_gripper_closes_opens_and_stalls_with_the_effort_of_the_goal(robot):
    robot.plugin.context.model.set_joint_positions(
        robot.model.index(["l_gripper_finger_joint", "r_gripper_finger_joint"]), np.array([0.05, 0.05]))
    goal = robot.grip(0.0, 0.0)
    robot.run(1.5)
    state, result = robot.result(GRIPPER, goal)
    assert state == GoalStatus.SUCCEEDED and result.reached_goal and not result.stalled and result.position < 0.002
    goal = robot.grip(0.06, 5.0)
    robot.run(1.5)
    assert robot.result(GRIPPER, goal)[1].reached_goal
    assert robot.at("l_gripper_finger_joint", "r_gripper_finger_joint") == pytest.approx([0.03, 0.03], abs=2e-3)
    # Beyond what it can open, as far as it goes: not reached, and a success.
    goal = robot.grip(0.3, 5.0)
    robot.run(4.0)
    state, result = robot.result(GRIPPER, goal)
    assert state == GoalStatus.SUCCEEDED and result.stalled and result.position == pytest.approx(0.1, abs=2e-3)


def test_a_held_gripper_pushes_with_the_effort_of_the_goal(robot):
    fingers = robot.model.index(["l_gripper_finger_joint", "r_gripper_finger_joint"])
    robot.model.set_joint_positions(fingers, np.array([0.05, 0.05]))
    for finger in fingers:
        robot.model.set_limits(finger, 0.02, 0.05)
    robot.grip(0.0, 6.0)
    robot.run(1.5)
    assert robot.model.read_joints()[2][fingers] == pytest.approx([-6.0, -6.0], abs=0.05)
    assert robot.at("l_gripper_finger_joint")[0] == pytest.approx(0.02, abs=1e-3)


def test_the_base_turns_its_wheels_with_its_acceleration_and_stops_without_commands(robot):
    speed, reach = 0.15, 0.15 / 0.75
    for _ in range(5):
        robot.ros.subscriptions[BASE + "/command"].put(Twist(linear=Vector3(x=speed)))
        robot.run(0.1)
    turned = robot.at("l_wheel_joint", "r_wheel_joint")
    assert turned / 16.5289 == pytest.approx([speed * (0.5 - reach / 2)] * 2, rel=0.02)
    odometry = robot.ros.publishers["/odom"].messages[-1]
    assert odometry.pose.pose.position.x == pytest.approx(turned[0] / 16.5289, abs=2e-3)
    assert (odometry.header.frame_id, odometry.child_frame_id) == ("odom", "base_link")
    robot.run(0.6)
    assert robot.model.read_joints()[1][robot.model.index(["l_wheel_joint"])] == pytest.approx(0.0, abs=1e-3)


def test_joint_states_come_100_times_a_second(robot):
    robot.run(0.5)
    messages = robot.ros.publishers["/joint_states"].messages
    assert len(messages) in (50, 51)
    assert messages[-1].name == sorted(robot.model.joint_names)


@pytest.mark.parametrize(("parameters", "text"), [
    ({"type": "robot_controllers/CartesianTwistController"}, "'robot_controllers/CartesianTwistController'; the "
     "simulator serves robot_controllers/DiffDriveBaseController"),
    ({"type": FOLLOW, "joints": ["elbow"]}, "elbow"), ({"type": FOLLOW}, "joints is missing"), (None, "type is None"),
    ({"type": "robot_controllers/GravityCompensation", "root": "arm", "tip": "torso"}, "no such chain"),
    ({"type": "robot_controllers/GravityCompensation", "root": "torso", "tip": "hand"}, "no such chain"),
    ({"type": "robot_controllers/DiffDriveBaseController", "radians_per_meter": 0}, "radians_per_meter is 0")])
def test_a_controller_that_cannot_be_served_is_one_warning_and_the_others_run(make_robot, parameters, text):
    robot = make_robot(["wrong", *NAMES], {"wrong": parameters, **CONTROLLERS})
    assert len(robot.log.lines) == 1
    assert "controller 'wrong' is left out" in robot.log.of("warn")[0] and text in robot.log.of("warn")[0]
    goal = robot.move(ARM, ["arm_joint"], [0.1], 0.2)
    robot.run(0.4)
    assert robot.result(ARM, goal)[0] == GoalStatus.SUCCEEDED


def test_a_reset_ends_goals_and_holds_the_joints_where_they_were_put(robot):
    goal = robot.move(BOTH, ["torso_joint", "arm_joint"], [0.2, 1.0], 2.0)
    robot.run(0.5)
    robot.model.set_joint_positions(robot.model.index(["arm_joint"]), np.array([-0.7]))
    robot.plugin.joints_set()
    robot.run(0.5)
    assert robot.result(BOTH, goal)[0] == GoalStatus.PREEMPTED
    assert robot.at("arm_joint")[0] == pytest.approx(-0.7, abs=1e-3)


def test_the_weight_of_a_chain_of_both_kinds_of_joints():
    chain = CarriedChain(parse_urdf(URDF), "base_link", "arm")
    assert chain.joints == ["torso_joint", "arm_joint"]
    for angle in (0.0, 0.4, -1.1):
        weight = ARM_KG * GRAVITY_M_S2
        assert chain.efforts([0.2, angle]) == pytest.approx(
            [5 * GRAVITY_M_S2 + weight, -weight * ARM_M * math.cos(angle)])


# base_link is 1 m above the world's origin.
@pytest.mark.parametrize("point", [(1.5, 0.8, 0.5), (1.0, -0.4, 1.2), (3.0, 0.4, 0.0)])
def test_the_head_looks_at_a_point_in_a_frame_of_the_robot(robot, point):
    goal = robot.look("base_link", point, seconds=0.5)
    robot.run(0.3)
    assert robot.off_sight(np.add(point, (0, 0, 1))) > 0.02
    robot.run(2.0)
    assert robot.result(POINT, goal)[0] == GoalStatus.SUCCEEDED
    assert robot.off_sight(np.add(point, (0, 0, 1))) < 0.01
    robot.run(0.5)
    assert robot.off_sight(np.add(point, (0, 0, 1))) < 0.01


def test_a_point_in_the_frame_of_a_link_that_moves(robot):
    point = robot.model.link_pose("arm").matrix() @ (1.5, 0.3, 0.2, 1.0)
    goal = robot.look("/arm", (1.5, 0.3, 0.2))
    robot.run(2.0)
    assert robot.result(POINT, goal)[0] == GoalStatus.SUCCEEDED
    assert robot.off_sight(point[:3]) < 0.02


def test_a_point_in_another_frame_waits_for_its_transform(robot):
    goal = robot.look("map", (0.0, 0.0, 0.0), seconds=0.2)
    robot.run(0.1)
    for name, parent, child, x in (("/tf_static", "map", "odom", 1.0), ("/tf", "odom", "base_link", -3.0)):
        placed = Transform(Vector3(x, 0.0, 0.0), Quaternion(0.0, 0.0, 0.0, 1.0))
        stamped = TransformStamped(Header(frame_id=parent, stamp=Time(1)), child, placed)
        robot.ros.subscriptions[name].put(TFMessage([stamped]))
    robot.run(1.5)
    assert robot.result(POINT, goal)[0] == GoalStatus.SUCCEEDED
    # The map's origin is 2 m ahead of base_link.
    assert robot.off_sight((2.0, 0.0, 1.0)) < 0.01
    assert "/tf" not in robot.ros.subscriptions, "nobody listens to tf any more"


def test_a_frame_that_nobody_knows_and_a_point_that_is_none_are_rejected(robot):
    for frame, written in (("nowhere", "'nowhere'"), ("no\0where", "'no\\x00where'")):
        goal = robot.look(frame, (1.0, 0.0, 0.0))
        robot.run(1.2)
        assert robot.result(POINT, goal)[0] == GoalStatus.REJECTED
        text = robot.ros.publishers[POINT + "/result"].messages[-1].status.text
        assert "frame %s is no link of the robot" % written in text
    for x in (math.nan, -math.inf, 1e308):
        goal = robot.look("base_link", (x, 0.0, 0.0))
        robot.run(0.01)
        assert robot.result(POINT, goal)[0] == GoalStatus.REJECTED


def test_a_gripper_goal_that_is_no_number_is_rejected_and_starts_nothing(robot):
    goal = robot.grip(math.nan, 1.0)
    robot.run(0.01)
    assert robot.result(GRIPPER, goal)[0] == GoalStatus.REJECTED
    assert not any(controller.name in GRIPPER for controller in robot.plugin._crew._running)


def test_the_head_stops_at_its_limits_keeps_to_the_speed_and_says_how_far_it_is_off(robot):
    goal = robot.look("base_link", (-2.0, 0.1, 1.0), max_velocity=1.0)
    fastest = 0.0
    for _ in range(300):
        robot.run(0.01)
        fastest = max(fastest, *np.abs(robot.model.read_joints()[1][robot.model.index(HEAD)]))
    assert 0.9 < fastest < 1.05
    assert robot.result(POINT, goal)[0] == GoalStatus.SUCCEEDED
    assert robot.at("head_pan_joint")[0] == pytest.approx(1.57, abs=0.01)
    text = robot.ros.publishers[POINT + "/result"].messages[-1].status.text
    assert float(text.split()[2]) == pytest.approx(robot.off_sight((-2.0, 0.1, 2.0)), abs=0.01)


def test_a_new_goal_a_cancel_and_a_trajectory_take_the_head_over(robot):
    first = robot.look("base_link", (1.0, 1.0, 0.5), seconds=2.0)
    robot.run(0.3)
    second = robot.look("base_link", (1.0, -1.0, 0.5), seconds=0.5)
    robot.run(0.1)
    assert robot.result(POINT, first)[0] == GoalStatus.PREEMPTED
    third = robot.move(PAN_TILT, list(HEAD), [0.0, 0.0], 1.0)
    robot.run(0.1)
    assert robot.result(PAN_TILT, third)[0] == GoalStatus.REJECTED
    robot.ros.subscriptions[POINT + "/cancel"].put(GoalID(id=second))
    robot.run(0.05)
    assert robot.result(POINT, second)[0] == GoalStatus.PREEMPTED
    rested = robot.at(*HEAD)
    robot.run(0.3)
    assert robot.at(*HEAD) == pytest.approx(rested, abs=0.02)
    third = robot.move(PAN_TILT, list(HEAD), [0.3, 0.2], 0.5)
    robot.run(1.2)
    assert robot.result(PAN_TILT, third)[0] == GoalStatus.SUCCEEDED
