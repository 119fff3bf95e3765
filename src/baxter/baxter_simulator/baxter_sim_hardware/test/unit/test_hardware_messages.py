# SPDX-License-Identifier: BSD-3-Clause
"""Messages as a physical robot sends and takes them: late, joint states in two; grippers not calibrated."""
import numpy as np
import pytest
from baxter_core_msgs.msg import EndEffectorCommand

from baxter_model import JOINTS, SIDES
from baxter_sim_hardware.message_delay import Late, MessageDelay

TORQUE, RAW = 3, 4
NAMES = tuple("%s_%s" % (side, joint) for side in SIDES for joint in JOINTS)
TICK_S = 0.002
ROWS = {"least": {"message": 0.005}, "most": {"message": 0.008}}


def test_delays_are_within_bounds_differ_and_follow_from_seed_stream_and_tick():
    delay = MessageDelay(ROWS, 7)
    found = [delay.of(1, tick) for tick in range(200)]
    assert 0.005 <= min(found) < 0.0055 and 0.0075 < max(found) <= 0.008
    assert found == [MessageDelay(ROWS, 7).of(1, tick) for tick in range(200)]
    assert found != [delay.of(2, tick) for tick in range(200)]
    assert found != [MessageDelay(ROWS, 8).of(1, tick) for tick in range(200)]


def test_none_overtakes_another_and_each_arrives_once():
    late = Late()
    late.send(0.000, 0.008, "first")
    late.send(0.002, 0.005, "second")
    assert late.arrived(0.007) == [] and late
    assert late.arrived(0.008) == ["first", "second"] and not late
    late.send(0.010, 0.005, "lost")
    late.drop()
    assert late.arrived(1.0) == []


def command_ticks(lab):
    """How many ticks after it was sent a command of left_w2 is taken, again and again."""
    found = []
    for number in range(12):
        goal = lab.position
        goal[6] += 0.05 * (-1) ** number
        lab.command(RAW, goal[:7], ["left_" + joint for joint in JOINTS])
        ticks = 0
        while lab.plugin._baxter.arms._points.goal[6] != goal[6] and ticks < 20:
            lab.run(TICK_S)
            ticks += 1
        found.append(ticks)
        lab.run(0.02)
    return found


def test_commands_take_5_to_8_milliseconds(make_lab):
    found = [command_ticks(make_lab(parameters={"enable": True, "effects": "delay"})) for _ in range(2)]
    # A command that is there at once is taken in the first tick.
    assert set(found[0]) == {4, 5}
    assert found[0] == found[1]
    assert set(command_ticks(make_lab(parameters={"enable": True}))) == {1}


def test_joint_states_take_5_to_8_milliseconds_and_say_when_they_were_measured(make_lab):
    lab = make_lab(parameters={"enable": True, "effects": "delay", "joint_state_rate": 100})
    lab.run(0.05)
    messages, found = lab.publishers["joint_states"].messages, []

    def note(lab):
        while len(found) < len(messages):
            found.append((lab.world.time_s - messages[len(found)].header.stamp.to_sec()) / TICK_S)

    messages.clear()
    lab.run(1.0, after=note)
    assert len(found) >= 99
    assert set(np.round(found).astype(int)) == {3, 4}
    stamps = [message.header.stamp.to_sec() for message in messages]
    np.testing.assert_allclose(np.diff(stamps), 0.01, atol=1e-6)


def test_what_is_on_its_way_is_lost_when_the_joints_are_put_elsewhere(make_lab):
    lab = make_lab(parameters={"enable": True, "effects": "delay"})
    lab.run(0.05)
    start = lab.position
    lab.command(RAW, start + 0.2)
    lab.run(TICK_S)
    lab.plugin.joints_set()
    lab.run(0.2)
    np.testing.assert_allclose(lab.position, start, atol=1e-3)


def test_joint_states_come_in_two_messages_at_100_hz_with_what_the_robot_lists(make_lab):
    lab = make_lab(parameters={"enable": True, "effects": "states"})
    lab.run(1.0)
    messages = lab.publishers["joint_states"].messages
    arms = ["head_nod", "head_pan", *sorted("%s_%s" % (side, joint) for side in SIDES for joint in JOINTS), "torso_t0"]
    fingers = ["%s_gripper_%s_finger_joint" % (side, finger) for side in "lr" for finger in "lr"]
    assert messages[0].name == arms and messages[1].name == fingers
    assert 2 * 100 <= len(messages) <= 2 * 101
    values = dict(zip(arms, messages[0].position, strict=True))
    assert values["head_nod"] == values["torso_t0"] == 0.0
    np.testing.assert_allclose([values["left_" + joint] for joint in JOINTS], lab.position[:7], atol=1e-3)
    true = dict(zip(lab.model.joint_names, lab.model.read_joints()[0], strict=True))
    np.testing.assert_allclose(messages[-1].position, [true[name] for name in fingers], atol=1e-6)


def gripper(lab, command, args="", sequence=0):
    lab.send("end_effector/left_gripper/command", EndEffectorCommand(65538, command, args, "test", sequence))
    lab.run(0.05)
    return lab.last("end_effector/left_gripper/state")


def test_grippers_start_uncalibrated_and_do_not_move_until_they_are(make_lab):
    lab = make_lab(parameters={"enable": True, "effects": "uncalibrated"})
    lab.run(0.05)
    assert [lab.last("end_effector/%s_gripper/state" % side).calibrated for side in SIDES] == [0, 0]
    before = gripper(lab, "no_op").position
    assert gripper(lab, "go", '{"position": 0}').position == pytest.approx(before, abs=0.5)
    assert "not calibrated" in lab.log.lines[-1]
    gripper(lab, "calibrate", sequence=1)
    lab.run(2.5)
    assert gripper(lab, "no_op").calibrated == 1
    lab.run(0.3)
    assert gripper(lab, "go", '{"position": 0}').moving == 1
    lab.plugin.reset()
    lab.run(0.05)
    assert lab.last("end_effector/left_gripper/state").calibrated == 1


def test_reference_states_have_each_joints_torque_beside_its_name(make_lab):
    lab, torque = make_lab(parameters={"enable": True}), 0.05 * np.arange(1, 15)
    lab.run(0.05, before=lambda lab: lab.command(TORQUE, torque))
    message = lab.last("ref_joint_states")
    told = dict(zip(message.name, message.effort, strict=True))
    assert [told[name] for name in NAMES] == pytest.approx(torque)
