# SPDX-License-Identifier: BSD-3-Clause
"""The arm without a physics engine beside the physics; recordings; a hidden robot is found again."""
from pathlib import Path

import numpy as np
import pytest
import rospkg

import xacro
from baxter_model import JOINTS, SIDES, joint_names, poses
from baxter_sim_hardware import effects
from baxter_sim_hardware.arms.actuators import NUMBERS
from baxter_sysid.arm_body import TICK_S, arm_body, hand_in_last, holding_torques, with_load
from baxter_sysid.errors import SysidError
from baxter_sysid.excitation import AMPLITUDES, PERIOD_S, motion
from baxter_sysid.identify import DELAY, HELD, LOAD_M, MASS, FittedModel, Settings, identify, table_of
from baxter_sysid.recording import ArmRecording, start_of
from baxter_sysid.replay import replay, set_points
from baxter_sysid.sheet import errors, numbers, worst_seconds
from bullet_sim import World
from urdf_model import parse_urdf

POSTURE = np.array([0.349, -0.436, -0.698, 1.047, -0.349, 1.396, 0.0])


@pytest.fixture(scope="module")
def robot():
    path = Path(rospkg.RosPack().get_path("baxter_description")) / "urdf/baxter.urdf.xacro"
    bare = xacro.process_file(str(path), mappings={"%s_gripper" % side: "none" for side in SIDES}).toxml()
    return parse_urdf(bare, source=str(path))


@pytest.fixture(scope="module")
def rows():
    return effects.read(effects.physical_robot())["lag"]


def actuators(rows, side):
    return np.array([effects.per_joint(rows, number, joint_names(side)) for number in NUMBERS])


def test_the_weight_of_an_arm_is_that_of_an_independent_computation(robot):
    """Rigid-body dynamics of the vendor's description without a gripper, in a posture that a robot published."""
    for side in SIDES:
        np.testing.assert_allclose(holding_torques(arm_body(robot, side), POSTURE),
                                   [0.0, -44.04, -10.57, -9.19, -1.48, 0.62, -0.02], atol=0.02)


def test_joints_are_damped_as_in_the_physics(robot):
    """The wrist is so light that a tick is too long for the damping of its description."""
    world = World(time_step_s=TICK_S, find_mesh=lambda name: None, warn=lambda text: None)
    try:
        model = world.spawn(robot, "baxter", static=True)
        for side in SIDES:
            index = model.index(joint_names(side))
            np.testing.assert_allclose(arm_body(robot, side).damping, model.damping[index], rtol=1e-6)
            assert model.damping[index[-1]] < 0.5 * robot.joints["%s_w2" % side].damping
    finally:
        world.close()


def test_fingers_weigh_on_the_last_joint(robot):
    path = Path(rospkg.RosPack().get_path("baxter_description")) / "urdf/baxter.urdf.xacro"
    gripping = parse_urdf(xacro.process_file(str(path)).toxml(), source=str(path))
    links = [name for name in gripping.links if name.startswith(("left_gripper", "l_gripper"))]
    weight = sum(gripping.links[name].inertial.mass for name in links if gripping.links[name].inertial is not None)
    more = arm_body(gripping, "left").masses.sum() - arm_body(robot, "left").masses.sum()
    assert more == pytest.approx(weight, abs=1e-3) and weight > 0.3


def test_a_load_pulls_by_its_lever(robot):
    body, hand = arm_body(robot, "left"), hand_in_last(robot, "left")
    stretched = np.zeros(7)
    more = holding_torques(with_load(body, 1.0, hand[:3, 3]), stretched) - holding_torques(body, stretched)
    assert more[1] == pytest.approx(-9.81 * 0.967, abs=0.15)


def test_set_points_are_reached_a_period_after_their_command():
    commanded = np.zeros((6, 1))
    commanded[1:] = 0.1
    points = set_points(commanded, 0.01, 0.0)[:, 0]
    np.testing.assert_allclose(points[:11], [0, 0, 0, 0, 0, 0.02, 0.04, 0.06, 0.08, 0.1, 0.1], atol=1e-12)


def test_set_points_of_commands_with_jitter_are_the_same_on_the_average():
    commanded = np.linspace(0.0, 2.0, 201)[:, None]
    plain, late = (set_points(commanded, 0.01, 0.006, jitter)[:, 0] for jitter in (0.0, 0.003))
    assert (np.diff(late) >= 0.0).all() and 1e-4 < np.abs(late - plain).max() < 0.007
    assert abs(np.mean(late - plain)) < 5e-4
    # Some of them wait for the next command.
    assert (np.diff(late[20:]) == 0.0).sum() > 5 and (np.diff(plain[20:]) > 0.0).all()


def test_set_points_rest_as_often_as_those_of_a_loop_that_takes_commands_at_its_ticks():
    """A set-point takes as many ticks for its way as lay between the last two commands; then it waits for the next."""
    period, jitter, rows = 0.01, 0.003, 4001
    late = 0.006 + jitter * (np.random.default_rng(1).random(rows) - 0.5)
    came = np.round((period * np.arange(rows) + late) / TICK_S)
    gaps = np.diff(came)
    waiting = np.maximum(np.diff(gaps), 0.0).sum() / gaps.sum()
    points = set_points(np.linspace(0.0, 40.0, rows)[:, None], period, 0.006, jitter)[10:, 0]
    assert np.mean(np.diff(points) < 1e-12) == pytest.approx(waiting, rel=0.1)


def test_an_arm_at_rest_stays_and_a_moving_one_begins_in_motion(robot, rows):
    body, table = arm_body(robot, "left"), actuators(rows, "left")
    still = np.tile(POSTURE, (100, 1))
    resting = replay(body, body, table, (POSTURE, np.zeros(7)), set_points(still, 0.01, 0.0), 0.01)
    assert np.abs(resting.position - POSTURE).max() < 1e-3 and not resting.bounded.any()
    swing = POSTURE + 0.3 * np.sin(2.0 * 0.01 * np.arange(200))[:, None]
    position, velocity = start_of(swing[100:], 0.01)
    assert velocity == pytest.approx(0.6 * np.cos(2.0), abs=0.01) and position == pytest.approx(swing[100], abs=1e-3)
    assert (start_of(still, 0.01)[1] == 0.0).all()


def test_the_excitation_is_slow_and_ends_where_it_begins(robot):
    for side in SIDES:
        way = motion(side, 20.0)
        middle = np.array(list(poses().angles("neutral", side).values()))
        np.testing.assert_array_equal(way[[0, -1]], [middle, middle])
        assert (np.abs(way - middle) <= list(AMPLITUDES.values())).all()
        assert np.abs(np.diff(way, axis=0) / PERIOD_S).max() < 1.6


def hidden(rows, seed):
    random = np.random.default_rng(seed)
    return {**rows, **{number: {joint: rows[number][joint] * random.uniform(0.8, 1.25) for joint in JOINTS}
                       for number in ("proportional_gain", "motor_damping")}}


HELD_NM = -0.35


def record(robot, rows, side, seed, mass=0.0, delay=0.0, seconds=12.0):
    """A recording of a robot with these numbers, in counts with noise; at its start, w0's friction bears."""
    body, hand = arm_body(robot, side), hand_in_last(robot, side)
    loaded = with_load(body, mass, hand[:3, :3] @ [0.0, 0.0, LOAD_M] + hand[:3, 3])
    commanded = motion(side, seconds)
    held = HELD_NM * np.eye(7)[JOINTS.index("w0")]
    done = replay(loaded, body, actuators(rows, side), (commanded[0], np.zeros(7), held),
                  set_points(commanded, PERIOD_S, delay), PERIOD_S).position
    counts = (done + 4e-4 * np.random.default_rng(seed).standard_normal(done.shape)) / 0.000383495
    return ArmRecording(PERIOD_S * np.arange(len(done)), {side: commanded}, {side: 0.000383495 * np.round(counts)})


@pytest.fixture(scope="module")
def found(robot, rows):
    truth = hidden(rows, 5)
    recording = record(robot, truth, "left", 5, mass=0.8, delay=0.012)
    return truth, recording, identify(FittedModel(robot, rows, recording, ("left",),
                                                  Settings(load=True, delay=True, excess=False)))


def test_a_hidden_robot_with_a_weight_and_late_messages_is_found_again(found):
    truth, _, result = found
    for (number, joint), value, deviation in zip(result.names, result.values, result.deviations, strict=True):
        if number in truth and truth[number][joint] > 0.1:
            # Twelve seconds show the wrist, which carries least, to 6 %, and friction as well as the sheet says.
            most = max((0.06 if joint == "w2" else 0.05) * truth[number][joint],
                       3.0 * deviation if number == "friction" else 0.0)
            assert value == pytest.approx(truth[number][joint], abs=most), (number, joint)
            assert deviation < 0.1 * truth[number][joint]
    assert result.value(MASS) == pytest.approx(0.8, rel=0.05) and result.value(DELAY) == pytest.approx(0.012, rel=0.05)
    assert np.sqrt(np.mean(result.after ** 2, axis=0)).max() < 8e-4
    assert np.sqrt(np.mean(result.without ** 2, axis=0)).max() < 8e-4


def test_the_sheet_has_each_joint_and_each_number_once(found):
    _, recording, result = found
    assert [line.split()[0] for line in errors(result)] == ["joint", *joint_names("left")]
    assert len(numbers(result)) == sum(name[0] != HELD for name in result.names) + len(result.refused)
    assert result.value((HELD, "left_w0")) == pytest.approx(HELD_NM, abs=0.02)
    lines = worst_seconds(recording.time_s, result.before[:, 0], result.motions[0], list(joint_names("left")),
                          {"left_s0": [(recording.time_s[k], "in contact") for k in range(0, 1500, 10)]})
    assert len(lines) == 7 and lines[0].endswith("in contact") and "in contact" not in lines[1]


def test_what_is_fitted_is_the_arms_own_in_the_file_that_is_written(found, rows, tmp_path):
    import yaml
    _, _, result = found
    table = table_of(yaml.safe_load(effects.physical_robot().read_text(encoding="utf-8")), result, "a test's robot")
    path = tmp_path / "robot.yaml"
    path.write_text(yaml.safe_dump(table))
    read = effects.read(path)["lag"]
    gains = effects.per_joint(read, "proportional_gain", joint_names("left"))
    np.testing.assert_allclose(gains, result.numbers["left"][NUMBERS.index("proportional_gain")], rtol=1e-4)
    np.testing.assert_array_equal(effects.per_joint(read, "proportional_gain", joint_names("right")),
                                  effects.per_joint(rows, "proportional_gain", joint_names("right")))


def test_a_recording_is_what_was_written(tmp_path, robot, rows):
    recording = record(robot, rows, "right", 1, seconds=1.0)
    recording.write(tmp_path / "arm.csv")
    again = ArmRecording.read(tmp_path / "arm.csv")
    np.testing.assert_allclose(again.sensed["right"], recording.sensed["right"], atol=1e-6)
    assert set(again.commanded) == {"right"} and again.period_s == pytest.approx(0.01)


@pytest.mark.parametrize("text, said", [
    ("time_s,left_s0_commanded_rad\n0,0\n", "has no column"), ("time_s,left\n0,0\n", "seven joints"),
    ("time_s," + ",".join("left_%s_%s_rad" % (joint, kind) for joint in JOINTS for kind in ("commanded", "sensed"))
     + "\n" + 40 * ("0," + ",".join(["0.1"] * 14) + "\n"), "times must rise")])
def test_a_file_that_is_no_recording_is_refused(tmp_path, text, said):
    path = tmp_path / "bad.csv"
    path.write_text(text)
    with pytest.raises(SysidError, match=said):
        ArmRecording.read(path)
