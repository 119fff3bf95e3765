# SPDX-License-Identifier: BSD-3-Clause
"""Single joints commanded as in the vendor's simulator, which had a controller for each."""
import numpy as np
import pytest
from std_msgs.msg import Float64

from baxter_model import JOINTS, SIDES

HEARD = ("*controller/state", "head/head_state")
NAMES = tuple("%s_%s" % (side, joint) for side in SIDES for joint in JOINTS)


def send(lab, group, joint, value):
    side, short = joint.split("_")
    lab.send("%s_joint_%s_controller/joints/%s_controller/command" % (side, group, joint), Float64(value))


def test_each_joint_goes_to_its_position_and_stays(lab):
    goal = lab.position + 0.1 * np.cos(np.arange(14))
    for joint, value in zip(NAMES, goal, strict=True):
        send(lab, "position", joint, value)
    lab.run(1.0)
    assert np.abs(lab.position - goal).max() < 1e-3


@pytest.mark.parametrize("group, value", [("velocity", 0.3), ("effort", 0.5)])
@pytest.mark.parametrize("side", SIDES)
def test_velocities_and_efforts_move_one_joint_and_expire(lab, group, value, side):
    joint = side + "_w2"
    index, start = NAMES.index(joint), lab.position
    lab.run(0.4, before=lambda lab: send(lab, group, joint, value))
    moved = lab.position - start
    assert moved[index] > 0.05 and np.abs(np.delete(moved, index)).max() < 0.02
    lab.run(0.5)
    assert np.abs(lab.velocity).max() < 1e-3


@pytest.mark.parametrize("side", SIDES)
def test_the_controllers_of_a_moving_joint_tell_their_states(lab, side):
    joint = side + "_w1"
    index, start = NAMES.index(joint), lab.position[NAMES.index(joint)]
    send(lab, "position", joint, start + 0.5)
    lab.run(0.12)
    position, velocity = (lab.last("%s_joint_%s_controller/joints/%s_controller/state" % (side, group, joint))
                          for group in ("position", "velocity"))
    for state, value, within in ((position, lab.position[index], 0.05), (velocity, lab.velocity[index], 1.0)):
        assert state.process_value == pytest.approx(value, abs=within)
        assert state.set_point == pytest.approx(value, abs=within)
        assert state.error == pytest.approx(state.set_point - state.process_value, abs=1e-12)
        assert (state.time_step, state.p) == (0.002, 0.0) and state.header.stamp.to_sec() > 0.1
    assert velocity.process_value > 0.5 and start + 0.05 < position.process_value < start + 0.5
    lab.run(1.0)
    position = lab.last("%s_joint_position_controller/joints/%s_controller/state" % (side, joint))
    assert position.set_point == pytest.approx(start + 0.5, abs=1e-6) and abs(position.error) < 1e-3
    assert abs(position.command) > 0.1  # what carries the hand


def test_the_head_turns(lab):
    lab.send("head_position_controller/joints/head_controller/command", Float64(0.5))
    lab.run(1.0)
    assert lab.last("head/head_state").pan == pytest.approx(0.5, abs=1e-3)
    state = lab.last("head_position_controller/joints/head_controller/state")
    assert (state.set_point, state.error) == pytest.approx((0.5, 0.0), abs=1e-3)


def test_what_is_refused_is_refused_as_a_joint_command(make_lab):
    lab = make_lab()
    start = lab.position
    send(lab, "position", "left_s0", 0.5)
    lab.send("head_position_controller/joints/head_controller/command", Float64(0.5))
    lab.run(0.5)
    assert np.abs(lab.position - start).max() < 1e-3
    assert any("left limb: joint command ignored: " in line for line in lab.log.lines)
    assert any("head_position_controller" in line for line in lab.log.lines)
