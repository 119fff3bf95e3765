# SPDX-License-Identifier: BSD-3-Clause
"""The node without ROS: when it makes a step, what it takes from messages and what it says of them."""
import sys
import threading
import xmlrpc.client
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import rospy
from control_msgs.msg import JointJog
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion, Twist, TwistStamped, Vector3
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from motion_planning.errors import PlanningError
from moveit_servo import node as module
from moveit_servo.node import ServoNode, settings_of, topics_of
from moveit_servo.servo import Status
from moveit_servo.settings import ARRAY, TRAJECTORY, UNITLESS, ServoSettings, SettingsError
from moveit_servo.telling import Telling, kind_of

sys.path.insert(0, str(Path(__file__).parents[1]))
from steered_arms import planar_model  # noqa: E402

PERIOD_S = 0.008
SETTINGS = ServoSettings(move_group_name="arm", planning_frame="base", command_out_topic="out", command_out_type=ARRAY)


class Topic:
    """A publisher that somebody hears; sent: what was published."""

    def __init__(self, *_, **__):
        self.sent = []

    def publish(self, message):
        self.sent.append(message)

    def get_num_connections(self):
        return 1


@pytest.fixture()
def node(monkeypatch):
    """The node of the planar arm, whose threads have ended; ``log``: its lines."""
    log, nothing = [], lambda *_, **__: None

    def say(text, *parts):
        log.append(text % parts if parts else text)

    def tf_frame(name):
        raise PlanningError("there is no frame %r" % name)
    monkeypatch.setattr(module, "rospy", SimpleNamespace(
        Publisher=Topic, Subscriber=nothing, Service=nothing, get_param=lambda name, default: default,
        get_time=lambda: 5.0, get_name=lambda: "/lab/servo_server", is_shutdown=lambda: True, logwarn=say,
        logwarn_once=say, logwarn_throttle=lambda _, text: say(text)))
    monkeypatch.setattr(module, "SceneMonitor", lambda *_: SimpleNamespace(scene=nothing, tf_frame=tf_frame))
    monkeypatch.setattr(module, "sphere_model_of", nothing)
    monkeypatch.setattr(module, "ConvexParts", nothing)
    monkeypatch.setattr(ServoNode, "_prepare", nothing)
    made = ServoNode(planar_model(), None, SETTINGS, None)
    made.log = log
    return made


@pytest.mark.parametrize("speed", [float("nan"), float("-inf"), 1e308])
def test_a_velocity_that_is_none_counts_as_0(node, speed):
    node._on_joints(JointState(name=["turn0", "turn1"], position=[0.1, 0.2], velocity=[speed, 0.5]))
    assert node._q[:2].tolist() == [0.1, 0.2] and node._velocity.tolist() == [0.0, 0.5, 0.0]
    assert "turn0" in node.log[0] and "count as 0" in node.log[0]


@pytest.mark.parametrize("angle", [float("nan"), float("inf"), 1e300, -3.6])
def test_where_no_joint_can_be_is_ignored_and_told(node, angle):
    node._on_joints(JointState(name=["turn0", "turn1"], position=[0.1, 0.2]))
    node._on_joints(JointState(name=["turn0", "turn1"], position=[angle, 0.3]))
    assert node._q[:2].tolist() == [0.1, 0.3]
    line, = node.log
    assert "turn0 is said to be at %g" % angle in line


class Clock:
    """ROS time that goes on only while somebody sleeps."""

    def __init__(self, monkeypatch):
        self.now = 5.0
        monkeypatch.setattr(module.rospy, "get_time", lambda: self.now)
        monkeypatch.setattr(module.rospy, "is_shutdown", lambda: False)
        monkeypatch.setattr(module.rospy, "sleep", self.sleep)

    def sleep(self, seconds):
        self.now += seconds


@pytest.mark.parametrize("rests", (True, False))
def test_an_arm_at_rest_does_not_wait_for_its_step(monkeypatch, rests):
    clock, node = Clock(monkeypatch), ServoNode.__new__(ServoNode)
    node._news, node._rests = threading.Event(), rests
    node._news.set()
    settings = ServoSettings(move_group_name="arm", command_out_topic="out", publish_period=PERIOD_S)
    assert node._wait_until(clock.now + PERIOD_S, settings) is rests
    assert clock.now == pytest.approx(5.0 if rests else 5.0 + PERIOD_S)


NAN = float("nan")
BENT = [0.3, 0.6, 0.6]


def twist(x, frame="", stamp=0.0):
    return TwistStamped(Header(frame_id=frame, stamp=rospy.Time(stamp)), Twist(linear=Vector3(x, 0.0, 0.0)))


def pose(x, frame="base", w=1.0):
    return PoseStamped(Header(frame_id=frame), Pose(Point(x, 0.0, 0.0), Quaternion(w=w)))


def bend(node):
    node._on_joints(JointState(name=["turn0", "turn1", "turn2"], position=BENT))


def steps(node, count=1):
    """Make steps with an arm that follows."""
    for _ in range(count):
        node._step(5.0, PERIOD_S)
        if node._out.sent:
            node._q[:] = node._out.sent[-1].data


def test_what_is_refused_is_the_status_and_each_kind_is_logged(node):
    refused = [
        (node._on_twist, twist(0.1, "nowhere"), "nowhere"), (node._on_twist, twist(NAN), "not finite"),
        (node._on_twist, twist(0.1, stamp=1.0), "4.00 s after"), (node._on_pose, pose(0.5, w=3.0), "length 3"),
        (node._on_pose, pose(NAN), "position"), (node._on_twist, twist(0.1, "no\0where"), r"no\x00where"),
        (node._on_jog, JointJog(joint_names=["other"], velocities=[1.0]), "other"),
        (node._on_jog, JointJog(joint_names=["turn0", "turn1"], velocities=[1.0]), "2 names but 1")]
    for number, (take, message, word) in enumerate(refused, 1):
        for _ in range(3):
            take(message)
            steps(node)
        assert node._status.sent[-1].data == Status.INVALID
        assert len(node.log) == number and word in node.log[-1] and node._telling.said[1] == node.log[-1]


@pytest.mark.parametrize("size", [5e-324, 1e-160, 1e-12, 1.0, 1e9, 1e155, 1e300, 1.7e308])
@pytest.mark.parametrize("unit", [SETTINGS.command_in_type, UNITLESS])
def test_no_finite_command_is_an_error(node, size, unit):
    node.servo.settings = node._new_settings = replace(SETTINGS, command_in_type=unit, joint_scale=1e3)
    bend(node)
    row = Vector3(size, -size, size)
    messages = [(node._on_twist, TwistStamped(Header(frame_id="tip"), Twist(row, row))),
                (node._on_jog, JointJog(joint_names=["turn0", "turn1"], velocities=[size, -size])),
                (node._on_pose, PoseStamped(Header(frame_id="tip"), Pose(Point(size, -size, size), Quaternion(w=1.0))))]
    with np.errstate(over="raise", invalid="raise"):
        for take, message in messages:
            node._begin_again()
            for _ in range(30):  # longer than a way takes to settle
                take(message)
                steps(node)
            assert all(np.isfinite(one.data).all() for one in node._out.sent)


def test_a_target_told_from_the_hand_does_not_move_with_it(node):
    bend(node)
    begin = node.servo.pose(node._q)
    node._on_pose(pose(-0.05, "tip"))
    steps(node, 500)
    moved = np.linalg.inv(begin) @ node.servo.pose(node._q)
    assert moved[:3, 3] == pytest.approx([-0.05, 0.0, 0.0], abs=0.002)
    node._on_pose(pose(0.2, w=3.0))
    assert not node.commands.newest(5.0, SETTINGS)[0], "a bad pose ends the one before"


def test_steps_are_due_a_period_ahead_at_most(node, monkeypatch):
    now, ahead = [5.0], []

    def wait(due, _):  # a command comes each millisecond to an arm that moves, in low_latency_mode
        ahead.append(due - now[0])
        now[0] += 0.001
        return False

    monkeypatch.setattr(module.rospy, "get_time", lambda: now[0])
    monkeypatch.setattr(node, "_wait_until", wait)
    node._steps(lambda: len(ahead) > 20)
    assert max(ahead) <= PERIOD_S + 1e-9


def watched(node, monkeypatch, **parameters):
    """The log after three looks at ``parameters``."""
    looks = iter([False] * 3 + [True])
    values = {"move_group_name": "arm", "command_out_topic": "out", "command_out_type": ARRAY, **parameters}
    monkeypatch.setattr(module, "time", SimpleNamespace(sleep=lambda _: None, monotonic=lambda: 1.0))
    text = xmlrpc.client.dumps((values,))  # each time other objects, as from the master
    monkeypatch.setattr(module.rospy, "get_param", lambda *_: xmlrpc.client.loads(text)[0][0])
    node._watch_parameters(lambda: next(looks))
    return node.log


def test_a_parameter_that_is_no_number_is_refused_once(node, monkeypatch):
    line, = watched(node, monkeypatch, incoming_command_timeout=NAN)
    assert "incoming_command_timeout is nan" in line


def test_what_is_read_at_the_start_stays_and_that_is_said(node, monkeypatch):
    lines = watched(node, monkeypatch, command_out_type=TRAJECTORY, move_group_name="other", publish_period=0.02)
    assert len(lines) == 2 and all(line.endswith("takes effect at the next start") for line in lines)
    bend(node)
    node._on_twist(twist(0.1))
    steps(node, 2)
    assert node.servo.settings.publish_period == 0.02 and node._out.sent[-1].data


def test_a_margin_without_room_is_refused_by_the_joints_name(node):
    with pytest.raises(SettingsError, match="joint_limit_margin is 2.5.*2.5, half.*turn0"):
        node.servo.settings = replace(SETTINGS, joint_limit_margin=2.5)


def test_the_whole_of_the_parameters_is_no_number(node, monkeypatch):
    monkeypatch.setattr(module, "time", SimpleNamespace(sleep=lambda _: None, monotonic=lambda: 1.0))
    monkeypatch.setattr(module.rospy, "get_param", lambda *_: 5)
    looks = iter([False] * 3 + [True])
    node._watch_parameters(lambda: next(looks))
    line, = node.log
    assert "is 5; expected" in line and node._new_settings is node.servo.settings


@pytest.mark.parametrize("name", ["cartesian_command_in_topic", "status_topic", "joint_topic", "command_out_topic"])
@pytest.mark.parametrize("topic", ["two words", "-x", "~", "/"])
def test_a_topic_without_a_legal_name_is_refused(node, name, topic):
    with pytest.raises(SettingsError, match="%s is '%s'; expected a topic's name" % (name, topic)):
        settings_of({"move_group_name": "arm", "command_out_topic": "out", name: topic}, node.model)


def test_topics_are_named_as_by_moveits_nodes():
    new = ServoSettings(command_out_topic="out", joint_topic="states")
    assert topics_of(new, "/lab/servo_server") == {
        "cartesian_command_in_topic": "~delta_twist_cmds", "joint_command_in_topic": "~delta_joint_cmds",
        "joint_topic": "states", "status_topic": "~status", "command_out_topic": "~out"}
    old = ServoSettings(cartesian_command_in_topic="jog_server/twists", joint_command_in_topic="jog_server/jogs",
                        status_topic="jog_server/halted", command_out_topic="group/command")
    assert topics_of(old, "/jog_server") == {
        "cartesian_command_in_topic": "~twists", "joint_command_in_topic": "~jogs", "joint_topic": "joint_states",
        "status_topic": "~halted", "command_out_topic": "group/command"}


def test_a_reason_holds_nothing_that_ends_a_terminals_program(node, monkeypatch):
    monkeypatch.setattr(module, "time", SimpleNamespace(sleep=lambda _: None, monotonic=lambda: 1.0))
    node._on_twist(twist(0.1, "no\0where\x1b[2J" + 10**4 * "x"))
    steps(node)
    looks = iter([False, True])
    node._tell_reasons(lambda: next(looks))
    said = node._reason.sent[-1].data
    assert said.isprintable() and "no\\x00where" in said and len(said) < 1100


def test_time_that_stands_still_is_told(node, monkeypatch):
    now = [100.0]
    monkeypatch.setattr(module.time, "monotonic", lambda: now[0])
    bend(node)
    steps(node)
    now[0] += 20.0
    node._tell_without_steps(now[0])
    assert node._status.sent.pop().data == Status.NO_WARNING and not node.log, "nobody steers"
    node._on_twist(twist(0.1))
    node._tell_without_steps(now[0] + 0.1)
    assert node._status.sent.pop().data == Status.INVALID
    assert "for 20 s: ROS time stands at 5.000 s" in node._telling.said[1] and len(node.log) == 1
    node._on_twist(twist(0.1, "nowhere"))
    node._tell_without_steps(now[0] + 1.1)
    steps(node)
    now[0] += 5.0
    node._tell_without_steps(now[0])
    assert node._status.sent[-1].data == Status.NO_WARNING


def test_a_reason_stays_until_it_is_read():
    telling, fine = Telling(), (Status.NO_WARNING, "")
    assert telling.take(Status.JOINT_BOUND, "a limit", 1.0) is Status.JOINT_BOUND
    assert telling.take(*fine, 1.01) is Status.NO_WARNING and telling.said == (Status.JOINT_BOUND, "a limit")
    assert telling.take(*fine, 1.51) is Status.NO_WARNING and telling.said == fine
    telling.refuse("no", 2.0)
    assert telling.take(*fine, 2.9) is Status.INVALID and telling.said == (Status.INVALID, "no")
    assert telling.take(*fine, 3.01) is Status.NO_WARNING
    assert kind_of("4.2e-3 s, [nan, -1.0] of left_w1") == kind_of("7 s, [2, inf] of left_w1") != kind_of("of left_w2")
