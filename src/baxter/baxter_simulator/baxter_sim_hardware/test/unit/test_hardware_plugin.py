# SPDX-License-Identifier: BSD-3-Clause
"""The plugin's topics: rates, names, fields; and how it handles messages."""
import inspect
import random
from pathlib import Path

import numpy as np
import pytest
import roslib.message
from baxter_core_msgs.msg import JointCommand
from std_msgs.msg import Bool, Empty, Float64, UInt16

from baxter_model import JOINTS, ModelMismatch
from baxter_model.description import limbs_of
from baxter_sim_hardware.robot_state import BaxterState
from baxter_sim_hardware.topics import interface
from gazebo_ros.model_plugin import PluginError
from urdf_model import parse_urdf
from urdf_model.transforms import matrix_from_quaternion

SIDES = ("left", "right")
NAMES = tuple("%s_%s" % (side, joint) for side in SIDES for joint in JOINTS)
FINGERS = tuple("%s_gripper_%s_finger_joint" % (hand, finger) for hand in "lr" for finger in "lr")


def intervals(lab, topic):
    """Time between messages [s]; the first may be shorter, because the grid of a rate does not begin at the spawn."""
    return np.diff([time_s for time_s, _ in lab.publishers[topic].timed])


@pytest.mark.parametrize("mode, parameters, most_ticks", [
    (1, {"enable": True}, 5), (3, {"enable": True}, 1), (None, {"disabled": "sink"}, 1)])
def test_what_balances_gravity_is_as_new_as_the_drives_need_it(make_lab, monkeypatch, mode, parameters, most_ticks):
    lab = make_lab(parameters=parameters)
    asked, real = [], lab.model.gravity_efforts
    monkeypatch.setattr(lab.model, "gravity_efforts", lambda q: asked.append(lab.world.tick) or real(q))
    if mode:
        lab.command(mode, lab.position if mode == 1 else np.zeros(14))
    lab.run(0.1)
    assert np.diff(asked).max() == most_ticks
    # After joints were moved by a service, the old gravity torques must not be used.
    while asked[-1] == lab.world.tick - 1 and most_ticks > 1:
        lab.run(0.002)
    lab.plugin.joints_set()
    lab.run(0.002)
    assert asked[-1] == lab.world.tick - 1


def test_rates_are_exact(make_lab):
    lab = make_lab()
    lab.run(2.0)
    np.testing.assert_allclose(intervals(lab, "joint_states")[1:], 0.02, atol=1e-9)
    for topic in ("state", "limb/left/endpoint_state", "limb/right/gravity_compensation_torques"):
        np.testing.assert_allclose(intervals(lab, topic)[1:], 0.01, atol=1e-9)
    assert len(lab.publishers["sim/started"].messages) == 1


def test_every_row_of_the_table_is_opened(make_lab):
    lab = make_lab()
    for row in interface.TOPICS:
        for _, name in row.names():
            assert name in (lab.publishers if row.is_published else lab.subscriptions)


@pytest.mark.parametrize("rate", [100, 500])
def test_joint_state_rate_parameter_and_topic(make_lab, rate):
    lab = make_lab(parameters={"joint_state_rate": rate})
    lab.run(1.0)
    assert len(lab.publishers["joint_states"].messages) == pytest.approx(rate, abs=1)
    lab.send("joint_state_publish_rate", UInt16(20))
    lab.run(1.0)
    np.testing.assert_allclose(intervals(lab, "joint_states")[-10:], 0.05, atol=1e-9)
    lab.send("joint_state_publish_rate", UInt16(0))
    lab.run(0.01)
    assert "must be from 1 to 1000" in lab.log.lines[-1]


@pytest.mark.parametrize("rate", [0, -5, "fast", float("nan"), 1e9])
def test_senseless_joint_state_rate_refuses_the_model(make_lab, rate):
    with pytest.raises(PluginError, match="joint_state_rate"):
        make_lab(parameters={"joint_state_rate": rate})


def test_a_message_that_is_not_built_refuses_the_model_by_its_name(make_lab, monkeypatch):
    find = roslib.message.get_message_class
    monkeypatch.setattr(roslib.message, "get_message_class",
                        lambda name: None if name == "sensor_msgs/PointCloud" else find(name))
    with pytest.raises(PluginError, match="no message sensor_msgs/PointCloud"):
        make_lab()


@pytest.mark.parametrize("name, value", [("profile", "turbo"), ("disabled", "float")])
def test_senseless_choices_refuse_the_model(make_lab, name, value):
    with pytest.raises(PluginError, match="%s is '%s'; choices are" % (name, value)):
        make_lab(parameters={name: value})


@pytest.mark.parametrize("value", ["no", "off", "yes", 2])
def test_enable_is_true_or_false(make_lab, value):
    with pytest.raises(PluginError, match="enable is .*must be true or false"):
        make_lab(parameters={"enable": value})


def test_robot_without_an_arm_is_refused():
    stick = parse_urdf('<robot name="stick"><link name="base"/></robot>', source="stick")
    with pytest.raises(ModelMismatch, match="robot 'stick' has no left_s0"):
        limbs_of(stick)


def test_first_joint_state_is_the_start_pose(make_lab):
    expected = {
        "left": (0.192483, 1.047, 0.000806359, 0.491094, -0.178079, -0.0610333, -0.0124707),
        "right": (-0.272659, 1.047, -0.00123203, 0.49262, -0.0806423, -0.0620532, 0.0265941)}
    lab = make_lab(pose="start")
    lab.run(0.002)
    message = lab.publishers["joint_states"].messages[0]
    for side in SIDES:
        for joint, angle in zip(JOINTS, expected[side], strict=True):
            name = "%s_%s" % (side, joint)
            assert message.position[message.name.index(name)] == pytest.approx(angle, abs=1e-4)


def test_joint_states_names_and_lengths(make_lab):
    lab = make_lab()
    lab.run(0.5)
    for message in lab.publishers["joint_states"].messages:
        assert message.name == sorted(("head_pan", *FINGERS, *NAMES))
        assert len(message.name) == 19
        assert len(message.position) == len(message.velocity) == len(message.effort) == 19
    state = dict(zip(message.name, message.position, strict=True))
    assert state["head_pan"] == pytest.approx(0.0, abs=1e-4)
    for finger in FINGERS:
        opening = 0.020833 if finger.endswith("_l_finger_joint") else -0.020833
        assert state[finger] == pytest.approx(opening, abs=1e-4)


def test_state_follows_enable_stop_reset(make_lab):
    lab = make_lab()

    def fields():
        lab.run(0.02)
        state = lab.last("state")
        return state.ready, state.enabled, state.stopped, state.estop_button, state.estop_source

    assert fields() == (False, False, False, 0, 0)
    lab.send("set_super_enable", Bool(True))
    assert fields() == (True, True, False, 0, 0)
    lab.send("set_super_stop", Empty())
    assert fields() == (False, False, True, 2, 2)
    lab.send("set_super_enable", Bool(True))
    assert fields() == (False, False, True, 2, 2)
    assert "enable ignored: the robot is stopped" in lab.log.lines[-1]
    lab.send("set_super_reset", Empty())
    assert fields() == (False, False, False, 0, 0)
    lab.send("set_super_enable", Bool(True))
    lab.send("set_super_stop", Empty())
    assert fields()[1:3] == (False, True)


def test_messages_of_one_tick_are_handled_in_the_order_of_the_table(make_lab):
    """However they came in: reset, enable, stop, then joint commands."""
    lab = make_lab()
    lab.command(1, lab.position + 0.1)
    lab.send("set_super_enable", Bool(True))
    lab.run(0.002)
    assert not any("ignored" in line for line in lab.log.lines)  # it met an enabled robot
    lab.send("set_super_stop", Empty())
    lab.command(1, lab.position + 0.1)
    lab.send("set_super_enable", Bool(True))
    lab.send("set_super_reset", Empty())
    lab.run(0.02)
    assert lab.last("state").stopped
    assert sum("joint command ignored: the robot is not enabled" in line for line in lab.log.lines) == 2  # one a limb
    assert list(interface.HANDLED_LAST) == [
        "set_super_reset", "set_super_enable", "set_super_stop", "joint_command", "joint_position_controller",
        "joint_velocity_controller", "joint_effort_controller"]


def test_every_function_of_a_row_is_a_method_for_its_kind_of_topic():
    assert len({row.key for row in interface.TOPICS}) == len(interface.TOPICS)
    for part in interface.PARTS:
        for row in part.TOPICS:
            latched = row.rate == interface.LATCHED
            assert len(inspect.signature(row.function).parameters) == (2 if latched else 4), row.key


def test_enable_parameter_enables_from_the_first_message(make_lab):
    lab = make_lab(parameters={"enable": True})
    lab.run(0.002)
    assert lab.last("state").enabled and lab.last("state").ready


@pytest.mark.parametrize("side", SIDES)
def test_endpoint_pose_is_the_tip_in_base(lab, side):
    lab.run(0.02)
    message = lab.last("limb/%s/endpoint_state" % side)
    assert message.header.frame_id == "base"
    tip = lab.model.link_pose(side + "_gripper").matrix()
    p, q = message.pose.position, message.pose.orientation
    np.testing.assert_allclose((p.x, p.y, p.z + 0.93), tip[:3, 3], atol=1e-6)
    np.testing.assert_allclose(matrix_from_quaternion((q.x, q.y, q.z, q.w))[:3, :3], tip[:3, :3], atol=1e-6)


@pytest.mark.parametrize("side", SIDES)
def test_endpoint_twist_is_the_tips_velocity(lab, side):
    lab.run(0.4, before=lambda lab: lab.command(2, np.tile([0.3, -0.2, 0.4, 0.3, 0.5, 0.4, 0.6], 2)))
    message = lab.last("limb/%s/endpoint_state" % side)
    assert message.header.stamp.to_sec() == pytest.approx(lab.world.time_s)
    index = lab.model.index([name for name in NAMES if name.startswith(side)])
    position, velocity, _ = lab.model.read_joints()
    jacobian = lab.plugin._arms._chains[side].jacobian(position[index])
    linear, angular = message.twist.linear, message.twist.angular
    twist = np.array((linear.x, linear.y, linear.z, angular.x, angular.y, angular.z))
    np.testing.assert_allclose(twist, jacobian @ velocity[index], atol=1e-6)
    true_linear, true_angular = lab.model.link_twist(side + "_gripper")
    np.testing.assert_allclose(twist, np.concatenate([true_linear, true_angular]), atol=2e-3)


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("force", [(10.0, 0.0, 0.0), (0.0, 10.0, 0.0), (0.0, 0.0, -10.0)])
def test_wrench_reads_a_push(lab, side, force):
    def push(lab):
        link = side + "_gripper"
        lab.model.apply_wrench(link, force, position=lab.model.link_pose(link).position)

    def wrench():
        return lab.last("limb/%s/endpoint_state" % side).wrench

    lab.run(0.3)
    assert np.abs((wrench().force.x, wrench().force.y, wrench().force.z)).max() < 0.2
    lab.run(0.5, before=push)
    np.testing.assert_allclose((wrench().force.x, wrench().force.y, wrench().force.z), force, atol=1.0)
    np.testing.assert_allclose((wrench().torque.x, wrench().torque.y, wrench().torque.z), 0.0, atol=0.3)


def test_wrench_stays_small_while_the_arm_moves_freely(lab):
    forces = []

    def note(lab):
        force = lab.last("limb/left/endpoint_state").wrench.force
        forces.append((force.x, force.y, force.z))

    lab.command(1, lab.position + np.tile([0.5, 0.4, 0.5, 0.5, 0.5, -0.5, 0.5], 2))
    lab.run(1.0, after=note)
    assert np.abs(forces).max() < 2.0


@pytest.mark.parametrize("side", SIDES)
def test_gravity_compensation_torques(lab, side):
    names = [name for name in NAMES if name.startswith(side)]
    index = lab.model.index(names)
    lab.run(0.02)
    message = lab.last("limb/%s/gravity_compensation_torques" % side)
    assert message.header.frame_id == "base"
    assert list(message.name) == names
    for field in message.__slots__[2:-1]:
        assert len(getattr(message, field)) == 7, field
    gravity = lab.model.gravity_efforts()[index]
    np.testing.assert_allclose(message.gravity_model_effort, gravity, atol=1e-6)
    np.testing.assert_allclose(message.actual_effort, gravity, atol=0.05)
    np.testing.assert_allclose(message.actual_position, message.commanded_position, atol=1e-3)


def test_a_thousand_malformed_commands_move_nothing(lab):
    rng = random.Random(5)
    start = lab.position
    values = [float("nan"), float("inf"), -float("inf"), 1e308, 0.0, 3.0]
    for number in range(1000):
        side = SIDES[number % 2]
        own = [name for name in NAMES if name.startswith(side)]
        names = rng.sample(own, rng.randint(1, 7))
        command = [rng.uniform(-1.0, 1.0) for _ in names]
        mode = rng.randint(1, 4)
        fault = number % 6
        if fault == 0:
            mode = rng.choice([0, 5, -1, 2**31 - 1, -2**31])
        elif fault == 1:
            command.append(0.5)
        elif fault == 2:
            command[rng.randrange(len(command))] = rng.choice(values[:3])
        elif fault == 3:
            names[rng.randrange(len(names))] = rng.choice(["", "left", "head_pan", "s0", "\u00e9", "right_hand"])
        elif fault == 4:
            names, command = [*names, names[0]], [*command, 0.1]
        else:
            names, command = [], []
        lab.send("limb/%s/joint_command" % side, JointCommand(mode=mode, names=names, command=command))
        if number % 10 == 9:
            lab.run(0.002)
    lab.run(0.1)
    assert np.abs(lab.position - start).max() < 1e-4
    assert 2 <= len([line for line in lab.log.lines if "ignored" in line]) <= 4  # one per limb and period
    lab.command(1, start + 0.1)
    lab.run(0.5)
    assert np.abs(lab.position - start - 0.1).max() < 1e-3


def test_documentation_lists_the_table():
    text = (Path(__file__).resolve().parents[6] / "docs" / "interface.md").read_text(encoding="utf-8")
    assert interface.markdown_table() in text, "rosrun baxter_sim_hardware interface_table prints it"


def test_an_observer_sees_each_joint_command_and_whether_it_was_obeyed(make_lab):
    lab = make_lab()
    seen = []
    lab.plugin.command_observers.append(lambda side, message, command: seen.append((side, message, command)))
    message = JointCommand(mode=1, names=["left_s0"], command=[0.3])
    lab.send("limb/left/joint_command", message)
    lab.run(0.002)
    assert seen == [("left", message, None)] and not lab.plugin.is_enabled
    lab.send("set_super_enable", Bool(True))
    lab.run(0.002)
    lab.send("limb/left/joint_command", message)
    lab.run(0.002)
    assert lab.plugin.is_enabled
    side, _, command = seen[1]
    assert (side, command.mode, list(command.values)) == ("left", 1, [0.3])


def test_starting_over_leaves_nothing_of_what_was_set(make_lab):
    lab = make_lab(parameters={"enable": True})
    lab.send("limb/left/set_speed_ratio", Float64(0.1))
    lab.send("limb/left/joint_command_timeout", Float64(9.0))
    lab.send("set_super_stop", Empty())
    lab.run(0.01)
    lab.plugin.start_over()
    arms = lab.plugin._baxter.arms
    assert (arms.speed_ratio("left"), arms.timeout("left")) == (1.0, 0.2)
    assert lab.plugin._baxter.state.state is BaxterState.DISABLED
    before = lab.model.read_joints()[0]
    lab.run(0.5)
    np.testing.assert_allclose(lab.model.read_joints()[0], before, atol=1e-3)
