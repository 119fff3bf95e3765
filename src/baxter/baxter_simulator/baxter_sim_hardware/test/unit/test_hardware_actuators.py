# SPDX-License-Identifier: BSD-3-Clause
"""The physical robot's actuators and sensors: what a program meets on the robot and not in front of ideal drives."""
import sys
from pathlib import Path

import numpy as np
import pytest
from trajectory_msgs.msg import JointTrajectoryPoint

from baxter_model import JOINTS, SIDES
from baxter_sim_hardware import effects
from baxter_sim_hardware.arms.actuators import Actuators
from baxter_sim_hardware.arms.joint_sensors import JointSensors
from baxter_sim_hardware.errors import BaxterHardwareError

HEARD = ("joint_states",)

POSITION, VELOCITY, TORQUE, RAW = 1, 2, 3, 4
TICK_S = 0.002
NAMES = ["%s_%s" % (side, joint) for side in SIDES for joint in JOINTS]
BENCH = Path(__file__).resolve().parents[6] / "tests" / "bench"
S0, S1, E1 = 0, 1, 3
# Stretched forward: the hand is some 1 m from s1.
STRETCHED = np.tile([0.0, -0.1, 0.0, 0.1, 0.0, 0.0, 0.0], 2)


@pytest.fixture()
def lagging(make_lab):
    def make(**parameters):
        return make_lab(parameters={"enable": True, "effects": "lag", **parameters}, angles=STRETCHED)

    return make


def hand(lab, side="left"):
    """(3,) where a hand is [m]."""
    part = lab.plugin._arms
    return part._chains[side].fk(lab.model.read_joints()[0][part._limb_index[side]])[:3, 3]


def pull(lab, force, seconds):
    """Hold the left hand with a force (3,) [N] in the frame of `base`; as a torque at each of the arm's joints."""
    part = lab.plugin._arms
    index = part._limb_index["left"]

    def push(lab):
        jacobian = part._chains["left"].jacobian(lab.model.read_joints()[0][index])
        lab.model.add_effort(index, jacobian[:3].T @ np.asarray(force))

    for _ in range(round(seconds / TICK_S)):
        lab.plugin.update(lab.world.time_s, TICK_S)
        push(lab)
        lab.world.step()
        lab.plugin.publish(lab.world.time_s)


def ramp(lab, joint, rate, seconds, said=False):
    """Stream one joint of the left arm at 100 Hz; returns by how much it is behind at the end [rad]."""
    start = lab.position
    target = start.copy()
    for k in range(round(seconds / 0.01)):
        target[joint] = start[joint] + rate * 0.01 * (k + 1)
        if said:
            velocities = np.zeros(7)
            velocities[joint] = rate
            lab.send("limb/left/inverse_dynamics_command", JointTrajectoryPoint(velocities=velocities.tolist()))
        lab.command(RAW, target)
        lab.run(0.01)
    return target[joint] - lab.position[joint]


def test_ideal_drives_are_what_one_gets_unasked(make_lab):
    lab = make_lab(parameters={"enable": True}, angles=STRETCHED)
    assert lab.plugin._baxter.actuators is None and lab.plugin._simulated._sensors is None
    assert ramp(lab, S0, 0.5, 0.5) < 0.02


def test_the_shoulder_is_behind_and_swings_beyond(lagging):
    lab = lagging()
    behind = ramp(lab, S0, 0.6, 1.0)
    assert 0.08 < behind < 0.18
    goal = lab.plugin._baxter.arms.commanded_position[S0]
    lab.command(RAW, lab.plugin._baxter.arms.commanded_position)
    position, _, _ = lab.record(2.0)
    way = goal - STRETCHED[S0]
    assert 0.02 * way < position[:, S0].max() - goal < 0.2 * way
    assert abs(position[-1, S0] - goal) < 0.006


def test_a_stream_that_says_its_velocity_is_followed_more_closely(lagging):
    behind = {said: abs(ramp(lagging(), S1, -1.1, 0.6, said=said)) for said in (False, True)}
    assert behind[True] < 0.5 * behind[False]


def test_a_push_gives_way_and_comes_back(lagging):
    lab = lagging()
    lab.run(1.0)
    before = hand(lab)
    pull(lab, [0.0, 20.0, 0.0], 4.0)
    assert 0.02 < hand(lab)[1] - before[1] < 0.08
    lab.run(7.0)
    np.testing.assert_allclose(hand(lab), before, atol=0.008)


def test_no_drive_exerts_more_than_its_limit(lagging):
    lab = lagging()
    limit = np.tile([50.0, 50.0, 50.0, 50.0, 15.0, 15.0, 15.0], 2)
    actuators, most = lab.plugin._baxter.actuators, np.zeros(14)

    def note(lab):
        whole = lab.model.read_joints()[2][lab.arm] + actuators.counterbalance(lab.position)
        most[:] = np.maximum(most, np.abs(whole))

    lab.command(RAW, STRETCHED + np.tile([0.8, -0.8, 1.5, 1.5, 2.0, 1.5, 2.0], 2))
    lab.run(0.5, after=note)
    lab.stop()
    lab.run(3.0, after=note)
    assert np.abs(lab.velocity).max() < 0.01
    # The spring between motor and link passes on a swing beyond what the motor exerts.
    assert (most < 1.5 * limit).all(), most / limit


def lift(seconds, from_rad=0.0, to_rad=-1.2, speed=2.0):
    """Set-points of s1 at 100 Hz that rise from rest to `speed` at once, as in the recording, and end at once."""
    return np.maximum(from_rad - speed * 0.01 * np.arange(1, round(seconds / 0.01) + 1), to_rad)


def test_both_arms_are_lifted_at_two_radians_a_second_as_far_behind_as_at_one(lagging):
    """Neither the description's 1.5 rad/s nor a bound of torque holds a raw set-point back that the robot follows."""
    late = {}
    for speed in (1.0, 2.0):
        lab, start = lagging(), STRETCHED.copy()
        start[[S1, 7 + S1]] = 0.0
        lab.command(POSITION, start)
        lab.run(4.0)
        behind, fastest = [], 0.0
        targets = lift(1.2 / speed + 0.8, speed=speed)
        for target in targets:
            start[[S1, 7 + S1]] = target
            lab.command(RAW, start)
            lab.run(0.01)
            behind.append(lab.position[[S1, 7 + S1]])
            fastest = max(fastest, -lab.velocity[S1])
        behind = np.array(behind)
        late[speed] = [0.01 * (np.argmax(arm < -0.8) - np.argmax(targets < -0.8)) for arm in behind.T]
        assert 0.9 * speed < fastest < 1.6 * speed
        assert behind.min() > -1.4
    assert np.abs(np.subtract(late[2.0], late[1.0])).max() < 0.06, late
    assert 0.15 < np.min(list(late.values())) and np.max(list(late.values())) < 0.26, late


def test_no_motor_goes_on_pushing_beyond_its_free_speed(lagging):
    """A raw set-point that jumps is followed as fast as motors turn, and no faster."""
    lab = lagging()
    lab.command(RAW, STRETCHED + np.tile([0.0, -1.5, 0.0, 2.0, 0.0, 0.0, 2.5], 2))
    _, velocity, _ = lab.record(0.19)
    assert (np.abs(velocity).max(axis=0) < 1.1 * lab.plugin._baxter.actuators.free_speed).all()


def test_a_spring_that_is_stronger_than_known_lifts_an_arm_that_moves(lagging):
    """At rest the integral has what the controller does not know of it; elsewhere that is too much or too little."""
    lab = lagging()
    rows = effects.read(effects.physical_robot())["lag"]
    rows["counterbalance_excess"] = {**rows["counterbalance_excess"], "s1": 0.3, "right_s1": 0.0}
    actuators = lab.plugin._baxter.actuators = Actuators(rows, NAMES)
    lab.run(0.5)
    assert np.abs(lab.position - STRETCHED).max() < 0.002
    extra = actuators.counterbalance(lab.position) - actuators.known_counterbalance(lab.position)
    assert extra[S1] == pytest.approx(0.3 * (37.3 - 2.43), abs=0.1) and abs(extra[7 + S1]) < 1e-9
    lab.command(POSITION, STRETCHED + np.tile([0.0, -0.9, 0.0, 0.0, 0.0, 0.0, 0.0], 2))
    lab.run(1.6)
    # There the spring carries 6.5 Nm less of that.
    assert lab.position[S1] > lab.position[7 + S1] + 0.01


@pytest.mark.parametrize("mode", [TORQUE, VELOCITY])
def test_changing_the_mode_does_not_jump(lagging, mode):
    lab = lagging()
    lab.run(0.5)
    lab.command(mode, np.zeros(14))
    lab.run(0.1)
    lab.command(POSITION, lab.position)
    position, _, _ = lab.record(1.5)
    assert np.abs(position - position[0]).max() < 0.03


def test_joints_that_are_put_elsewhere_stay_there(lagging):
    lab = lagging()
    ramp(lab, S0, 0.6, 0.5)
    lab.model.set_joint_positions(lab.arm, STRETCHED + 0.2)
    lab.plugin.joints_set()
    position, _, _ = lab.record(1.0)
    assert np.abs(position - STRETCHED - 0.2).max() < 0.01


def test_states_are_counts_with_noise_and_the_same_for_the_same_seed_whoever_listened(make_lab):
    said = []
    for heard in (True, False):
        lab = make_lab(parameters={"enable": True, "effects": "noise"}, angles=STRETCHED)
        for publisher in lab.publishers.values():
            publisher.has_listeners = heard
        lab.run(0.5)
        publisher = lab.publishers["joint_states"]
        publisher.has_listeners = True
        publisher.messages.clear()
        lab.run(1.0)
        messages = [dict(zip(message.name, message.position, strict=True))
                    for message in lab.publishers["joint_states"].messages]
        said.append(messages)
    assert said[0] == said[1]
    values = np.array([message["left_s0"] for message in messages])
    counts = values / 0.000383495
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-6)
    assert 0.5 < counts.std() < 2.5
    assert lab.position[S0] != values[-1]
    grippers = [name for name in messages[-1] if "gripper" in name]
    true = dict(zip(lab.model.joint_names, lab.model.read_joints()[0], strict=True))
    assert grippers and all(messages[-1][name] == true[name] for name in grippers)


@pytest.mark.parametrize("words", ["noise", "lag,noise"])
def test_the_error_of_a_sensor_s_gear_is_in_the_link_and_not_in_what_is_said(make_lab, words):
    """It is the same for the same robot; the controller reads the sensor, too."""
    off = []
    for serial in (5, 3, 3):
        lab = make_lab(parameters={"enable": True, "effects": words, "serial": serial}, angles=STRETCHED)
        goal = STRETCHED + 0.05
        lab.command(POSITION, goal)
        lab.run(3.0)
        publisher = lab.publishers["joint_states"]
        publisher.messages.clear()
        lab.run(0.5)
        said = np.mean([[dict(zip(message.name, message.position, strict=True))[name] for name in NAMES]
                        for message in publisher.messages], axis=0)
        assert np.abs(said - goal).max() < (0.0025 if "lag" in words else 4e-4)
        off.append(lab.position - said)
        assert 1e-3 < np.abs(off[-1]).max() < 0.0017 + 4e-4
    np.testing.assert_allclose(off[1], off[2], atol=1e-6)
    assert np.abs(off[0] - off[1]).max() > 5e-4


def test_links_and_sensors_are_inverse_to_each_other():
    rows = effects.read(effects.physical_robot())["noise"]
    sensors = JointSensors(rows, NAMES, 1, 5)
    position = np.random.default_rng(2).uniform(-3.0, 3.0, len(NAMES))
    np.testing.assert_array_equal(JointSensors(rows, NAMES, 1, 0).felt(position), position)
    felt, some = sensors.felt(position), np.array([0, 3, 12])
    assert 1e-3 < np.abs(felt - position).max() <= 0.0017
    np.testing.assert_allclose(sensors.reached(felt[some], some), position[some], atol=1e-8)


def test_a_recording_of_a_physical_robot_is_followed_by_both_arms(make_lab):
    """By the same numbers on both arms; ideal drives are up to 0.08 rad off."""
    sys.path.append(str(BENCH))
    try:
        from recording import Recording
    finally:
        sys.path.remove(str(BENCH))
    recording = Recording.read(BENCH / "recordings" / "baxter_tracking_100hz.csv", 14.0)
    lab = make_lab(parameters={"enable": True, "effects": "lag"}, angles=recording.sensed[0])
    lab.run(0.01)
    errors = []
    for commanded, sensed in zip(recording.commanded, recording.sensed, strict=True):
        errors.append(lab.position - sensed)
        lab.command(RAW, commanded)
        lab.run(0.01)
    assert np.sqrt(np.mean(np.square(errors), axis=0)).max() < 0.012
    assert len(errors) == 1400


@pytest.mark.parametrize("words, wanted", [
    ("none", set()), ("", set()), ("lag", {"lag"}), (" noise , lag", {"lag", "noise"}), ("all", set(effects.NAMES))])
def test_effects_by_name(words, wanted):
    assert effects.chosen(words) == wanted


@pytest.mark.parametrize("words", ["lags", "lag;noise", True, 3, None])
def test_an_unknown_effect_is_refused_with_the_names(words):
    with pytest.raises(BaxterHardwareError, match=r"effects (is|has) .*lag"):
        effects.chosen(words)


@pytest.mark.parametrize("text, said", [
    ("- lag", "has no section 'lag'"), ("lag: {gain: {values: {s0: .nan}}}\nnoise: {}", "lag.gain must have 'values'"),
    ("lag: [", "cannot be read"), ("lag: {gain: 3}\nnoise: {}", "lag.gain must have 'values'")])
def test_bad_files_say_what_is_wrong(tmp_path, text, said):
    path = tmp_path / "robot.yaml"
    path.write_text(text)
    with pytest.raises(BaxterHardwareError, match=said):
        effects.read(path)


@pytest.mark.parametrize("number, value, said", [
    ("motor_inertia", 0.0, "motor_inertia is 0"), ("friction", -1.0, "friction is negative"),
    ("friction", None, "has no value for joint 's0'")])
def test_numbers_that_no_actuator_has_are_refused(number, value, said):
    rows = effects.read(effects.physical_robot())["lag"]
    rows[number] = {**rows[number], "s0": value} if value is not None else {"s1": 1.0}
    with pytest.raises(BaxterHardwareError, match=said):
        Actuators(rows, ["%s_s0" % side for side in SIDES])


def test_each_number_has_a_unit_a_source_and_a_grade():
    import yaml
    table = yaml.safe_load(effects.physical_robot().read_text(encoding="utf-8"))
    assert set(table) == set(effects.SECTIONS)
    for effect, rows in table.items():
        for number, row in rows.items():
            assert set(row) == {"unit", "grade", "source", "values"}, (effect, number)
            assert row["grade"] in ("measured", "published", "memory", "fitted", "assumed") and len(row["source"]) > 10
