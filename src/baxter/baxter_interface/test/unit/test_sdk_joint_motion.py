# SPDX-License-Identifier: BSD-3-Clause
"""A move of the arm, against minimal simulated arms."""
import math

import pytest

from baxter_interface.joint_motion import (
    DISABLED_GRACE_S,
    PEAK_ACCELERATION_RAD_S2,
    PEAK_SPEED_RAD_S,
    Hindrance,
    Move,
    SmoothPath,
    Standstill,
    is_far,
)
from baxter_interface.settings import JOINT_ANGLE_TOLERANCE
from baxter_model.readiness import NOT_ENABLED

PERIOD_S = 0.01
# From the simulator's start pose to neutral: the widest way is 1.6 rad, at s1.
START = {"left_s0": 0.192483, "left_s1": 1.047, "left_e1": 0.491094, "left_w1": -0.0610333}
NEUTRAL = {"left_s0": 0.0, "left_s1": -0.55, "left_e1": 0.75, "left_w1": 1.26}


def drive(move, angles, lag_s=0.05, stuck=(), steps=3000, **knobs):
    """Drive an arm that follows commands with a lag of first order; returns (last step, its time, angles, commands)."""
    angles, commands = dict(angles), []
    speeds = dict.fromkeys(angles, 0.0)
    for i in range(steps):
        step = move.step(i * PERIOD_S, angles, speeds, **knobs)
        if step.command is not None:
            commands.append(step.command)
        if step.is_last:
            return step, i * PERIOD_S, angles, commands
        for name, target in (step.command or {}).items():
            speeds[name] = 0.0 if name in stuck else (target - angles[name]) / max(lag_s, PERIOD_S)
            angles[name] += speeds[name] * PERIOD_S
    raise AssertionError("the move did not end within %d steps" % steps)


def derivative(values):
    return [(b - a) / PERIOD_S for a, b in zip(values, values[1:], strict=False)]


@pytest.mark.parametrize("distance", [1e-6, 0.01, 0.3, 1.6, 3.0, -6.0])
@pytest.mark.parametrize("joint", sorted(PEAK_SPEED_RAD_S))
def test_path_starts_and_ends_at_rest_within_speed_and_acceleration(joint, distance):
    name = "right_" + joint
    path = SmoothPath({name: 0.1}, {name: 0.1 + distance})
    angles = [path.angles(i * PERIOD_S)[name] for i in range(int(path.duration_s / PERIOD_S) + 3)]
    speeds = derivative(angles)
    accelerations = derivative(speeds)
    assert angles[0] == pytest.approx(0.1, abs=1e-12)
    assert angles[-1] == 0.1 + distance
    assert max(map(abs, speeds)) <= PEAK_SPEED_RAD_S[joint] * 1.001
    assert max(map(abs, accelerations)) <= PEAK_ACCELERATION_RAD_S2 * 1.001
    assert abs(speeds[0]) < 0.05 and abs(speeds[-1]) < 0.05


def test_path_of_no_length_is_the_target_at_once():
    assert SmoothPath(NEUTRAL, NEUTRAL).angles(0.0) == NEUTRAL


def test_all_joints_are_equally_far_on_their_way():
    path = SmoothPath(START, NEUTRAL)
    angles = path.angles(0.4 * path.duration_s)
    shares = [(angles[name] - START[name]) / (NEUTRAL[name] - START[name]) for name in START]
    assert shares == pytest.approx([shares[0]] * len(shares))


def test_neutral_is_reached_in_a_few_seconds_exactly_and_at_rest():
    step, time_s, angles, commands = drive(Move(START, NEUTRAL, 15.0), START)
    assert step.arrived and not step.failure
    assert 2.0 < time_s < 4.0
    assert commands[-1] == NEUTRAL
    assert max(abs(angles[name] - NEUTRAL[name]) for name in NEUTRAL) < 1e-3


def test_path_may_be_sampled_at_any_rate():
    path = SmoothPath(START, NEUTRAL)
    assert path.angles(path.duration_s + 1e-9) == path.angles(100.0) == NEUTRAL


def test_only_the_joints_of_the_target_are_commanded():
    _, _, _, commands = drive(Move(START, {"left_w1": 1.0}, 15.0), START)
    assert {tuple(command) for command in commands} == {("left_w1",)}


def test_stuck_joint_is_named_with_its_error_and_the_threshold():
    step, time_s, _, commands = drive(Move(START, NEUTRAL, 15.0), START, stuck=("left_w1",))
    assert not step.arrived
    assert time_s == pytest.approx(15.0, abs=0.02)
    assert "left_w1 is 1.3210 rad from its target 1.2600 rad (threshold 0.0087 rad)" in step.failure
    assert commands[-1] == NEUTRAL, "the target stays commanded: the joint may come loose"


def test_time_too_short_for_the_way_leaves_the_last_command():
    step, time_s, angles, commands = drive(Move(START, NEUTRAL, 0.5), START)
    assert not step.arrived and time_s == pytest.approx(0.5, abs=0.011)
    assert abs(NEUTRAL["left_s1"] - commands[-1]["left_s1"]) < abs(NEUTRAL["left_s1"] - angles["left_s1"])
    assert "A gentle move takes" in step.failure


@pytest.mark.parametrize("timeout_s", [0.0, 0.01, 0.1, 0.3])
def test_a_loop_of_short_calls_moves_the_arm_as_the_vendors_filter(timeout_s):
    start, target = {"left_s0": 0.2}, {"left_s0": 0.5}
    angles, time_s = start, 0.0
    while time_s < 3.0:
        step, duration_s, angles, _ = drive(Move(angles, target, timeout_s), angles, lag_s=PERIOD_S)
        assert not step.is_last or "A gentle move takes" in step.failure or step.arrived
        # The last command of a call acts until the next one.
        angles = dict(step.command)
        time_s += duration_s + PERIOD_S
    # A low pass of 0.2 Hz leaves 1 - exp(-3 s / 0.8 s) = 2 % of the way.
    assert 0.27 < angles["left_s0"] - start["left_s0"] <= 0.3


def test_a_short_call_arrives_where_the_arm_is_near():
    near = {name: angle + 0.5 * JOINT_ANGLE_TOLERANCE for name, angle in NEUTRAL.items()}
    step = Move(near, NEUTRAL, 0.0).step(0.0, near, {})
    assert step.arrived and step.command == NEUTRAL


def test_an_arm_that_is_held_stays_where_it_is_and_says_why():
    move = Move(START, NEUTRAL, 15.0)
    step = move.step(3.0, START, {}, hindrance=Hindrance("too near to the head", True))
    assert step.is_last and not step.arrived and step.command == START
    assert "too near to the head" in step.failure and "left_s1 is 1.5970 rad" in step.failure
    hurried = Move(START, NEUTRAL, 0.0).step(0.0, START, {}, hindrance=Hindrance("too near to the head", True))
    assert "too near to the head" in hurried.failure and hurried.command != START, "the next call may lead away"
    late = Move(START, NEUTRAL, 15.0).step(15.0, START, {}, hindrance=Hindrance("its cuff is squeezed"))
    assert "its cuff" in late.failure and late.command == NEUTRAL


def look_at(standstill, moments):
    return [standstill.look(time_s, far, {"left_s0": angle}) for time_s, far, angle in moments]


def test_an_arm_stands_still_that_is_far_from_its_goal_and_does_not_move():
    still = look_at(Standstill(), [(t * 0.5, True, 0.001 * t) for t in range(5)])
    assert still == [0.0, 0.5, 1.0, 1.5, 2.0]
    assert max(look_at(Standstill(), [(t * 0.5, True, 0.03 * t) for t in range(9)])) == 0.0, "it moves"
    assert max(look_at(Standstill(), [(t * 0.5, False, 0.0) for t in range(9)])) == 0.0, "it is where it should be"
    assert look_at(Standstill(), [(9.0, True, 0.0), (1.0, True, 0.0)]) == [0.0, 0.0], "the clock went back"


def test_only_the_joints_of_a_goal_are_far_from_it():
    assert is_far(START, NEUTRAL) and not is_far(START, {"left_w1": START["left_w1"] + 0.01})


def test_own_test_stops_the_arm_where_it_is():
    step, time_s, angles, commands = drive(Move(START, NEUTRAL, 15.0), START, aborted=True)
    assert not step.arrived and time_s == 0.0 and "stopped by the test" in step.failure
    assert commands == [angles]


def test_disabled_robot_ends_the_move_and_nothing_more_is_commanded():
    step, time_s, _, _ = drive(Move(START, NEUTRAL, 15.0), START, refusal=NOT_ENABLED)
    assert not step.arrived and step.command is None
    assert "not enabled" in step.failure and "enable_robot.py -e" in step.failure
    assert time_s == pytest.approx(DISABLED_GRACE_S, abs=0.011)


def test_disabled_robot_at_the_target_has_not_arrived():
    step, _, _, _ = drive(Move(NEUTRAL, NEUTRAL, 15.0), NEUTRAL, refusal=NOT_ENABLED)
    assert not step.arrived and "not enabled" in step.failure


def test_late_news_of_enabling_does_not_end_the_move():
    move = Move(START, NEUTRAL, 15.0)
    assert not move.step(0.0, START, {}, refusal=NOT_ENABLED).is_last
    assert not move.step(0.1, START, {}, refusal="").is_last
    assert not move.step(0.3, START, {}, refusal=NOT_ENABLED).is_last


def test_wide_threshold_ends_the_move_in_passing_with_the_target_commanded():
    step, time_s, angles, commands = drive(Move(START, NEUTRAL, 15.0, 0.3), START)
    assert step.arrived and commands[-1] == NEUTRAL
    assert time_s < SmoothPath(START, NEUTRAL).duration_s
    assert max(abs(angles[name] - NEUTRAL[name]) for name in NEUTRAL) < 0.3


def test_arm_that_never_rests_arrives_after_the_settling_time():
    move = Move(NEUTRAL, NEUTRAL, 15.0)
    trembling = dict.fromkeys(NEUTRAL, 0.05)
    assert not move.step(0.0, NEUTRAL, trembling).is_last
    assert not move.step(0.4, NEUTRAL, trembling).is_last
    assert move.step(0.51, NEUTRAL, trembling).arrived


def test_arm_at_rest_at_its_target_has_arrived_at_once():
    assert Move(NEUTRAL, NEUTRAL, 15.0).step(0.0, NEUTRAL, dict.fromkeys(NEUTRAL, 0.0)).arrived


def test_no_time_limit_goes_on():
    assert not Move(START, NEUTRAL, None).step(1e6, START, {}).is_last


def test_error_just_over_the_threshold_is_no_arrival():
    off = {name: angle + 1.01 * JOINT_ANGLE_TOLERANCE for name, angle in NEUTRAL.items()}
    step = Move(off, NEUTRAL, 1.0).step(2.0, off, dict.fromkeys(off, 0.0))
    assert not step.arrived and math.isclose(step.command["left_s0"], 0.0)


def test_a_robot_that_was_put_elsewhere_is_halted_wherever_it_is_and_told_nothing_else():
    move = Move(START, NEUTRAL, 15.0)
    assert not move.step(0.5, START, {}).is_last
    step = move.step(0.51, START, {}, interrupted="the robot was put elsewhere")
    assert step.is_last and step.halt and step.command is None
    assert step.failure.startswith("the robot was put elsewhere; ")
