# SPDX-License-Identifier: BSD-3-Clause
"""Which joint commands are accepted, clamped or refused, and the texts of refusals. Both limbs throughout."""
import math
import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from baxter_model import JOINTS
from baxter_sim_hardware.arms.joint_command import ArmLimits, CommandParser, Mode
from baxter_sim_hardware.errors import CommandRefused

SIDES = ("left", "right")
NAMES = tuple("%s_%s" % (side, joint) for side in SIDES for joint in JOINTS)
LIMITS = ArmLimits(
    NAMES,
    lower=np.tile([-1.70167993878, -2.147, -3.05417993878, -0.05, -3.059, -1.57079632679, -3.059], 2),
    upper=np.tile([1.70167993878, 1.047, 3.05417993878, 2.618, 3.059, 2.094, 3.059], 2),
    velocity=np.tile([1.5, 1.5, 1.5, 1.5, 4.0, 4.0, 4.0], 2),
    effort=np.tile([50.0, 100.0, 50.0, 50.0, 15.0, 15.0, 15.0], 2))


def joints(side):
    return [name for name in NAMES if name.startswith(side)]


def parser(side):
    return CommandParser(LIMITS, joints(side))


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("mode", Mode)
def test_any_subset_in_any_order(side, mode):
    names = joints(side)[::-2]
    command = parser(side).parse(int(mode), names, [0.01 * n for n in range(len(names))])
    assert command.mode is mode
    assert [NAMES[index] for index in command.index] == names
    assert command.clamped == ()
    np.testing.assert_allclose(command.values, [0.01 * n for n in range(len(names))])


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("mode, value, expected", [
    (Mode.POSITION, -9.0, -2.147), (Mode.POSITION, 9.0, 1.047), (Mode.RAW_POSITION, 9.0, 1.047),
    (Mode.VELOCITY, 9.0, 1.5), (Mode.VELOCITY, -9.0, -1.5), (Mode.TORQUE, 900.0, 100.0), (Mode.TORQUE, -900.0, -100.0),
    (Mode.POSITION, 1e308, 1.047),
])
def test_out_of_range_is_clamped(side, mode, value, expected):
    name = side + "_s1"
    command = parser(side).parse(mode, [name], [value])
    assert command.values == pytest.approx([expected])
    unit = {Mode.VELOCITY: "rad/s", Mode.TORQUE: "Nm"}.get(mode, "rad")
    assert command.clamped == ("%s: %.5g became %.5g %s" % (name, value, expected, unit),)


def test_only_joints_out_of_range_are_told():
    command = parser("left").parse(Mode.POSITION, ["left_s0", "left_s1", "left_e1"], [45.0, 0.5, -30.0])
    assert command.clamped == ("left_s0: 45 became 1.7017 rad", "left_e1: -30 became -0.05 rad")


@pytest.mark.parametrize("side", SIDES)
def test_resting_on_a_limit_is_clamped_without_a_word(side):
    command = parser(side).parse(Mode.POSITION, [side + "_s1"], [1.047 + 1e-5])
    assert command.values == [1.047]
    assert command.clamped == ()


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("mode, names, values, said", [
    (0, ["s0"], [0.0], "unknown mode 0; modes are 1 POSITION, 2 VELOCITY, 3 TORQUE, 4 RAW_POSITION"),
    (5, ["s0"], [0.0], "unknown mode 5"),
    (-2147483648, ["s0"], [0.0], "unknown mode"),
    (1, ["s0", "s1"], [0.0], "2 names but 1 value"),
    (1, ["s0"], [], "1 name but 0 values"),
    (1, [], [], "no joints named"),
    (1, ["s9"], [0.0], "unknown joint '{side}_s9'; this limb's joints are {side}_s0, {side}_s1, {side}_e0"),
    (2, ["s0", "s0"], [0.0, 0.0], "{side}_s0 named more than once"),
    (3, ["s0"], [math.nan], "the value for {side}_s0 is nan"),
    (4, ["s0", "w2"], [0.0, math.inf], "the value for {side}_w2 is inf"),
])
def test_malformed_is_refused_whole(side, mode, names, values, said):
    with pytest.raises(CommandRefused) as refused:
        parser(side).parse(mode, ["%s_%s" % (side, name) for name in names], values)
    assert said.format(side=side) in str(refused.value)


@pytest.mark.parametrize("side, other", [SIDES, SIDES[::-1]])
def test_other_limbs_joints_are_unknown(side, other):
    with pytest.raises(CommandRefused, match="unknown joint '%s_s0'" % other):
        parser(side).parse(1, [other + "_s0"], [0.0])


ANY_NAME = st.sampled_from((*NAMES, "", "head_pan", "left_S0", "left_s0 ", "\u0000", "right_hand"))
ANY_FLOAT = st.floats(allow_nan=True, allow_infinity=True, width=64)


@pytest.mark.parametrize("side", SIDES)
@given(mode=st.integers(-2**31, 2**31 - 1) | st.integers(0, 5), names=st.lists(ANY_NAME, max_size=9),
       values=st.lists(ANY_FLOAT, max_size=9))
def test_fuzzed_commands_are_refused_or_inside_the_limits(side, mode, names, values):
    try:
        command = parser(side).parse(mode, names, values)
    except CommandRefused as refused:
        assert str(refused)
        return
    assert len(command.index) == len(names) == len(values) == len(set(names))
    assert set(names) <= set(joints(side))
    index = command.index
    if command.mode is Mode.VELOCITY:
        assert np.all(np.abs(command.values) <= LIMITS.velocity[index])
    elif command.mode is Mode.TORQUE:
        assert np.all(np.abs(command.values) <= LIMITS.effort[index])
    else:
        assert np.all((command.values >= LIMITS.lower[index]) & (command.values <= LIMITS.upper[index]))


def test_limits_of_the_wrong_length_are_an_error():
    with pytest.raises(ValueError, match="lower has shape"):
        ArmLimits(("a", "b"), [0.0], [1.0, 1.0], [1.0, 1.0], [1.0, 1.0])


def test_a_huge_command_is_refused_at_once():
    # Two hundred thousand names once blocked the loop, which holds the arms, for minutes.
    names = joints("left") * 30_000
    begin_s = time.process_time()
    with pytest.raises(CommandRefused, match="named more than once"):
        parser("left").parse(Mode.POSITION, names, [0.0] * len(names))
    assert time.process_time() - begin_s < 2.0
