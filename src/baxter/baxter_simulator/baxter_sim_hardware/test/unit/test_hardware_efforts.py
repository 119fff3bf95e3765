# SPDX-License-Identifier: BSD-3-Clause
"""The efforts that the arms report with the physical robot's actuators."""
import numpy as np
import pytest

import xacro
from baxter_model import JOINTS
from urdf_model import parse_urdf

HEARD = ("joint_states", "limb/*/gravity_compensation_torques")

TORQUE, RAW = 3, 4
# Around it all joints swing, so that gravity acts on most of them.
MIDDLE = np.tile([0.1, -0.4, 0.3, 1.1, -0.4, 0.9, 0.2], 2)
SWING = np.array([0.5, 0.4, 0.6, 0.5, 0.8, 0.6, 0.9])
RATE = np.array([1.3, 1.0, 1.7, 1.4, 2.3, 2.0, 2.7])  # [rad/s] of the swings, so the fastest joint has 2.4 rad/s
# What torque recordings of a left arm say: hysteresis [Nm] in the direction of motion.
HYSTERESIS_NM = dict(zip(JOINTS, (0.25, 0.71, 0.43, 0.09, 0.11, 0.02, 0.08), strict=True))


@pytest.fixture(scope="module")
def bare(robot_file):
    return parse_urdf(xacro.process_file(robot_file, mappings={
        "%s_electric_gripper" % side: "false" for side in ("left", "right")}).toxml())


@pytest.fixture()
def swinging(make_lab, bare):
    """(positions, velocities, rigid body's torques, told efforts), (n, 7) each, of a left arm in smooth motion."""
    lab = make_lab(model=bare, parameters={"enable": True, "effects": "lag", "joint_state_rate": 500}, angles=MIDDLE)
    rows, told = [], []

    def stream(lab):
        if lab.world.tick % 5 == 0:
            swing = SWING * np.sin(RATE * lab.world.time_s)
            lab.command(RAW, MIDDLE + np.tile(swing, 2))

    def note(lab):
        message = lab.last("joint_states")
        effort = dict(zip(message.name, message.effort, strict=True))
        told.append([effort["left_" + joint] for joint in JOINTS])
        rows.append([values.copy() for values in lab.model.read_joints()[:2]])

    lab.run(0.5, before=stream)
    lab.run(4.5, before=stream, after=note)
    position, velocity = np.array(rows).transpose(1, 0, 2)
    index = lab.model.index(["left_" + joint for joint in JOINTS])
    # Efforts of a tick belong to the state before it, and the change of speed in it. The drawing has damping.
    acceleration = np.diff(velocity, axis=0) / 0.002
    rigid = np.array([lab.model.inverse_dynamics(*row)[index] for row in zip(
        position, velocity, acceleration, strict=False)]) + lab.model.damping[index] * velocity[:-1, index]
    return position[:-1, index], velocity[:-1, index], rigid, np.array(told[1:])


def test_efforts_in_smooth_motion_are_those_of_a_physical_arm(swinging):
    """s1 has its spring, the others gravity and inertia as they are; all have hysteresis."""
    position, velocity, rigid, told = swinging
    for j, joint in enumerate(JOINTS):
        moves = np.abs(velocity[:, j]) > 0.1
        columns = [np.sign(velocity[moves, j]), np.ones(moves.sum())]
        if joint == "s1":
            columns.append(position[moves, j])
            found = np.linalg.lstsq(np.stack(columns, axis=1), told[moves, j] - rigid[moves, j], rcond=None)[0]
            assert found[1] == pytest.approx(37.3, abs=0.5) and found[2] == pytest.approx(24.3, abs=1.0)
        else:
            columns.append(rigid[moves, j])
            found = np.linalg.lstsq(np.stack(columns, axis=1), told[moves, j], rcond=None)[0]
            assert 0.94 < found[2] < 1.04, joint
        assert found[0] == pytest.approx(HYSTERESIS_NM[joint], abs=0.02 + 0.25 * HYSTERESIS_NM[joint]), joint
        assert abs(told[:, j] - rigid[:, j]).max() < 60.0


def test_gravity_compensation_tells_springs_apart_from_gravity(make_lab):
    lab = make_lab(parameters={"enable": True, "effects": "lag"}, angles=MIDDLE)
    lab.command(RAW, MIDDLE + 0.1)
    lab.run(1.5)
    message = lab.last("limb/left/gravity_compensation_torques")
    values = {name: np.array(getattr(message, name)) for name in message.__slots__[2:-1]}
    index = lab.model.index(message.name)
    gravity = lab.model.gravity_efforts()[index]
    np.testing.assert_allclose(values["gravity_only"], gravity, atol=0.05)
    spring = np.where(np.array(message.name) == "left_s1", 37.3 + 24.3 * lab.position[:7], 0.0)
    hysteresis = np.array(list(HYSTERESIS_NM.values()))
    told = values["hysteresis_model_effort"] - values["crosstalk_model_effort"]
    assert (np.abs(told - spring) < hysteresis + 0.02).all()
    np.testing.assert_allclose(values["gravity_model_effort"], values["gravity_only"] + told, atol=1e-9)
    assert -1.0 <= message.hystState <= 1.0
    assert told[1] - spring[1] == pytest.approx(0.71 * message.hystState, abs=0.02)
    # What is left of an effort without spring and hysteresis is the arm's weight.
    np.testing.assert_allclose(values["actual_effort"] - told, gravity, atol=0.3)
    np.testing.assert_allclose(values["actual_position"], lab.position[:7], atol=1e-3)
    np.testing.assert_allclose(values["commanded_position"], MIDDLE[:7] + 0.1, atol=1e-9)
    # At rest the controllers add what friction holds, and no more than a few Nm.
    assert (np.abs(values["commanded_effort"]) < 3.0).all()


def test_gravity_compensation_tells_what_is_commanded_in_motion(make_lab):
    lab = make_lab(parameters={"enable": True, "effects": "lag"}, angles=MIDDLE)
    lab.command(RAW, MIDDLE + np.tile([0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], 2))
    lab.run(0.1)
    message = lab.last("limb/left/gravity_compensation_torques")
    assert message.commanded_velocity[0] > 0.5 and message.commanded_effort[0] > 2.0
    accelerations = [message.commanded_acceleration[0]
                     for message in lab.publishers["limb/left/gravity_compensation_torques"].messages]
    assert max(accelerations) > 5.0


@pytest.mark.parametrize("torque", [-100.0, 100.0])
def test_torque_mode_stays_within_the_motors_whole_effort(make_lab, torque):
    """Of which s1's spring is no part: down it can push harder than up."""
    lab = make_lab(parameters={"enable": True, "effects": "lag"}, angles=MIDDLE)
    lab.run(0.2)
    command = np.zeros(14)
    command[1] = torque
    lab.command(TORQUE, command)
    lab.run(0.02)
    whole = lab.model.read_joints()[2][lab.arm][1] + 37.3 + 24.3 * lab.position[1]
    assert whole == pytest.approx(np.copysign(50.0, torque), abs=1.0)


def test_ideal_drives_tell_gravity_and_nothing_of_springs(make_lab):
    lab = make_lab(parameters={"enable": True}, angles=MIDDLE)
    lab.command(RAW, MIDDLE + 0.3)
    lab.run(0.1)
    message = lab.last("limb/left/gravity_compensation_torques")
    assert list(message.gravity_model_effort) == list(message.gravity_only)
    for name in ("hysteresis_model_effort", "crosstalk_model_effort", "commanded_acceleration", "commanded_effort"):
        assert list(getattr(message, name)) == [0.0] * 7, name
