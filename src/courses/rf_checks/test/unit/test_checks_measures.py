# SPDX-License-Identifier: BSD-3-Clause
"""Measures of motions, and mistakes recognized by their effect."""
import math

import numpy as np
import pytest

from rf_checks import measures, mistakes

TIMES = np.arange(0.0, 10.0, 0.01)


@pytest.mark.parametrize(("value", "share"), [(0.0, 1.0), (0.01, 1.0), (0.055, 0.5), (0.1, 0.0), (5.0, 0.0)])
def test_ramp_falls_from_full_to_none(value, share):
    assert measures.ramp(value, 0.01, 0.1) == pytest.approx(share)


def test_ramp_may_rise():
    assert measures.ramp(0.05, 0.05, 0.01) == 1.0
    assert measures.ramp(0.03, 0.05, 0.01) == pytest.approx(0.5)


@pytest.mark.parametrize("off", [(0.0, 0.0), (1e-4, 2e-4), (2e-4, 1e-4)])
def test_joints_at_their_goals_have_one_report_whichever_is_farther(off):
    share, farthest, words = measures.distance_from_goal(("s0", "s1"), (1.0 + off[0], -1.0 - off[1]), (1.0, -1.0))
    assert (share, words) == (1.0, "all joints are within 0.02 rad of their goals")
    assert farthest == pytest.approx(max(off))


def test_the_joint_that_is_off_its_goal_is_named():
    share, farthest, words = measures.distance_from_goal(("s0", "s1"), (0.0, 0.3), (0.0, 0.0))
    assert (share, farthest, words) == (0.5, 0.3, "farthest off is s1, by 0.300 rad")


@pytest.mark.parametrize("axis", "xyz")
@pytest.mark.parametrize("angle", [0.0, 0.3, -1.2, math.pi / 2, 3.0, -math.pi])
def test_rotations_and_quaternions_agree(axis, angle):
    rotation = mistakes.about(axis, angle)
    x, y, z, w = mistakes.quaternion_of(rotation)
    assert np.allclose(mistakes.rotation_of(w, x, y, z), rotation, atol=1e-9)
    assert mistakes.rotation_angle(rotation) == pytest.approx(abs(angle), abs=1e-9)
    expected = math.sin(angle / 2.0) * (1.0 if math.cos(angle / 2.0) >= 0.0 else -1.0)
    assert abs("xyz".index(axis) - int(np.argmax(np.abs((x, y, z))))) == 0 or angle == 0.0
    assert abs((x, y, z)["xyz".index(axis)]) == pytest.approx(abs(expected), abs=1e-9)


def test_halts_are_counted_between_beginning_and_end():
    position = np.concatenate([np.zeros(100), np.linspace(0, 1, 100), np.ones(50), np.linspace(1, 2, 100),
                               np.full(50, 2.0)])
    times = 0.01 * np.arange(len(position))
    assert measures.halts(times, position[:, None]) == 1
    assert measures.moving_rows(times, position[:, None]) == (100, 349)
    assert measures.halts(times, np.zeros((len(times), 1))) == 0


def test_a_speed_that_wavers_at_a_turning_point_is_one_halt():
    speed = np.concatenate((np.full(100, 0.2), np.tile(np.repeat((0.01, 0.04), 10), 8), np.full(100, 0.2)))
    position = np.cumsum(0.01 * speed)[:, None]
    assert measures.halts(0.01 * np.arange(len(position)), position) == 1


def test_a_jump_is_no_motion():
    assert measures.largest_jump(np.array([[0.0], [0.04], [0.9]])) == pytest.approx(0.86)
    assert measures.largest_jump(np.zeros((1, 7))) == 0.0


def wave(amplitude, frequency, shape=np.sin):
    phase = 2.0 * math.pi * frequency * TIMES
    path = np.zeros((len(TIMES), 3))
    path[:, 1] = amplitude * shape(phase)
    return path


@pytest.mark.parametrize(("amplitude", "frequency"), [(0.08, 0.5), (0.05, 1.3), (0.2, 0.3)])
def test_a_sine_is_found(amplitude, frequency):
    fit = measures.fit_sine(TIMES, wave(amplitude, frequency))
    assert fit.r_squared > 0.99
    assert fit.amplitude == pytest.approx(amplitude, rel=0.05)
    assert fit.frequency == pytest.approx(frequency, rel=0.05)
    assert fit.periods >= 2.9


def test_the_way_to_a_sine_is_left_out():
    approach = np.linspace((0.0, -0.6, 0.4), (0.0, 0.0, 0.0), 200)
    points = np.concatenate((approach, wave(0.08, 0.4)))
    fit = measures.fit_sine(0.01 * np.arange(len(points)), points)
    assert fit.r_squared > 0.98
    assert fit.amplitude == pytest.approx(0.08, rel=0.1)
    assert fit.periods > 2.9


@pytest.mark.parametrize("points", [np.zeros((1000, 3)), np.linspace((0, 0, 0), (0.6, 0.1, 0), 1000)],
                         ids=["still", "a straight line"])
def test_what_is_no_wave_is_no_sine(points):
    fit = measures.fit_sine(TIMES, points)
    assert fit.r_squared * min(1.0, fit.periods / 2.9) < 0.9 or fit.periods == 0.0


def test_a_square_wave_is_less_of_a_sine():
    assert measures.fit_sine(TIMES, wave(0.08, 0.5, lambda phase: np.sign(np.sin(phase)))).r_squared < 0.9


START = mistakes.rotation_of(0.052, -0.381, 0.923, -0.015)


@pytest.mark.parametrize("axis", "xyz")
def test_mistakes_of_a_rotation_differ_from_what_is_right_and_from_each_other(axis):
    angle = math.pi / 2
    right = START @ mistakes.about(axis, angle)
    wrong = mistakes.wrong_rotations(START, axis, angle)
    keys = {key for key, _, _ in wrong}
    assert keys == {"quaternion_order", "degrees", "wrong_axis", "wrong_direction", "not_turned"}
    for key, _, rotation in wrong:
        assert np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-9), key
        assert not mistakes.is_near(rotation, right), key


def test_a_quaternion_read_in_the_wrong_order_is_recognised():
    x, y, z, w = mistakes.quaternion_of(START)
    assert mistakes.is_xyzw_taken_as_wxyz(mistakes.rotation_of(x, y, z, w), START)
    assert not mistakes.is_xyzw_taken_as_wxyz(START, START)


NOTES = ["right_s0", "right_e1", "right_e1", "right_w0", "right_w1", "right_w1"]


@pytest.mark.parametrize(("names", "values", "key", "words"), [
    (NOTES, [0.1] * 7, "repeated_names", ["right_e1", "right_w1", "right_s1", "right_e0", "push_back"]),
    (["right_s0"], [0.1, 0.2], "lengths", ["1 name", "2 values"]),
    (["left_s0", "left_s1"], [45.0, -30.0], "degrees", ["left_s0", "45.0", "radians"]),
])
def test_mistakes_of_a_command_are_named(names, values, key, words):
    found, sentence = mistakes.command_slip([("right", 1, ["right_s0"], [0.2]), ("right", 1, names, values)])
    assert found == key
    assert all(word in sentence for word in words)


def test_a_right_command_has_no_slip():
    assert mistakes.command_slip([("right", 1, ["right_s0", "right_s1"], [3.0, -2.0])]) is None
