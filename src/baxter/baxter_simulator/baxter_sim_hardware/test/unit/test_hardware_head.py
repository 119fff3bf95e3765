# SPDX-License-Identifier: BSD-3-Clause
"""The head: set-points of the core, and the joint that follows them."""
import math

import numpy as np
import pytest
from baxter_core_msgs.msg import HeadPanCommand
from std_msgs.msg import Bool

from baxter_sim_hardware.errors import CommandRefused
from baxter_sim_hardware.head import ACCELERATION, FULL_SPEED, NOD_S, HeadHardware

HEARD = ("head/head_state", "joint_states")
LIMIT = math.pi / 2


def pan(lab):
    return lab.last("head/head_state").pan


def travel(head):
    """Set-points until the head rests: positions (ticks,) [rad]."""
    rows = []
    while (setpoint := head.update()) is not None:
        rows.append(setpoint[0][0])
        assert len(rows) < 50000
    return np.array(rows)


@pytest.mark.parametrize("ratio, speed", [
    (0.05, 0.42), (0.1, 0.84), (1.0, FULL_SPEED), (0.0, FULL_SPEED), (3.0, FULL_SPEED)])
def test_ratio_bounds_the_speed_and_zero_means_full(ratio, speed):
    head = HeadHardware(-LIMIT, LIMIT, 0.0)
    head.command_pan(1.5, ratio)
    path = travel(head)
    assert path[-1] == 1.5
    fastest = np.abs(np.diff(path)).max() / 0.002
    reachable = math.sqrt(1.5 * ACCELERATION)
    assert fastest == pytest.approx(min(speed, reachable), rel=0.02)
    assert np.abs(np.diff(path, 2)).max() / 0.002**2 <= ACCELERATION * 1.001
    assert path.max() == 1.5


def test_targets_are_clamped_to_the_limits():
    head = HeadHardware(-LIMIT, LIMIT, 0.0)
    head.command_pan(-4.0, 1.0)
    assert travel(head)[-1] == -LIMIT


def test_a_coarse_head_stops_short_and_does_not_start_for_less():
    head = HeadHardware(-LIMIT, LIMIT, 0.0, dead_band=0.05)
    head.command_pan(0.8, 1.0)
    assert travel(head)[-1] == pytest.approx(0.75)
    head.command_pan(0.79, 1.0)
    assert np.ptp(travel(head)) < 1e-9
    head.command_pan(-4.0, 1.0)
    assert travel(head)[-1] == pytest.approx(-LIMIT + 0.05)


@pytest.mark.parametrize("target, ratio", [(math.nan, 1.0), (math.inf, 1.0), (0.5, math.nan), (0.5, -0.1)])
def test_senseless_pan_is_refused(target, ratio):
    head = HeadHardware(-LIMIT, LIMIT, 0.0)
    with pytest.raises(CommandRefused, match="they must be an angle and a number from 0 to 1"):
        head.command_pan(target, ratio)
    assert (travel(head) == 0.0).all()


def test_disabled_pan_stays_until_it_is_enabled():
    head = HeadHardware(-LIMIT, LIMIT, 0.0)
    head.command_pan(1.0, 1.0, enable=False)
    head.command_pan(1.0, 1.0)
    assert not head.pan_enabled and travel(head)[-1] == 0.0
    head.command_pan(1.0, 1.0, enable=True)
    assert head.pan_enabled and travel(head)[-1] == 1.0


def test_a_nod_ends_and_is_not_prolonged_by_repeated_commands():
    head = HeadHardware(-LIMIT, LIMIT, 0.0)
    assert not head.is_nodding(3.0)
    head.nod(3.0)
    head.nod(3.0 + 0.9 * NOD_S)
    assert head.is_nodding(3.0) and head.is_nodding(3.0 + 0.95 * NOD_S)
    assert not head.is_nodding(3.0 + NOD_S)
    assert not head.is_nodding(1.0)  # the clock went back


def test_the_joint_follows(lab):
    lab.send("head/command_head_pan", HeadPanCommand(1.0, 0.05, 1))
    lab.run(1.0)
    state = lab.last("head/head_state")
    assert state.isTurning and state.isPanEnabled and not state.isNodding
    assert 0.38 < pan(lab) < 0.42
    lab.run(1.6)
    assert pan(lab) == pytest.approx(1.0, abs=1e-3)
    assert not lab.last("head/head_state").isTurning
    names = lab.last("joint_states").name
    assert lab.last("joint_states").position[names.index("head_pan")] == pytest.approx(1.0, abs=1e-3)


def test_full_speed_does_not_overshoot(lab):
    pans = []
    lab.send("head/command_head_pan", HeadPanCommand(1.2, 1.0, 1))
    lab.run(1.5, after=lambda lab: pans.append(lab.model.read_joints()[0][lab.model.index(["head_pan"])[0]]))
    assert max(pans) < 1.2 + 2e-3
    assert pans[-1] == pytest.approx(1.2, abs=1e-3)


def test_a_message_with_only_the_target_turns_the_head(lab):
    lab.send("head/command_head_pan", HeadPanCommand(target=-0.5))
    lab.run(1.0)
    assert pan(lab) == pytest.approx(-0.5, abs=1e-3)
    assert lab.last("head/head_state").isPanEnabled


def test_request_disables_panning(lab):
    lab.send("head/command_head_pan", HeadPanCommand(0.8, 1.0, 0))
    lab.run(0.5)
    assert pan(lab) == pytest.approx(0.0, abs=1e-3)
    assert not lab.last("head/head_state").isPanEnabled


def test_nod_rises_and_falls(lab):
    lab.send("head/command_head_nod", Bool(True))
    lab.run(0.02)
    assert lab.last("head/head_state").isNodding
    lab.send("head/command_head_nod", Bool(False))
    lab.run(NOD_S)
    assert not lab.last("head/head_state").isNodding


def test_disabled_robot_moves_no_head_and_stops_a_turn(lab):
    lab.send("head/command_head_pan", HeadPanCommand(1.2, 0.05, 1))
    lab.run(1.0)
    lab.stop()
    lab.run(0.02)
    stopped = pan(lab)
    lab.send("head/command_head_pan", HeadPanCommand(1.2, 1.0, 1))
    lab.send("head/command_head_nod", Bool(True))
    lab.run(0.5)
    assert pan(lab) == pytest.approx(stopped, abs=5e-3)
    assert not lab.last("head/head_state").isNodding
    assert any("command_head_pan refused: the robot is not enabled" in line for line in lab.log.lines)
    lab.plugin.reset()
    lab.run(0.1)
    assert pan(lab) == pytest.approx(stopped, abs=5e-3)
