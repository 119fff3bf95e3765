# SPDX-License-Identifier: BSD-3-Clause
"""Polynomials between points, and trajectories made of them."""
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from joint_trajectory import BeforeTrajectory, TrajectoryCommand, hold, replace, stop
from joint_trajectory.segment import CUBIC, LINEAR, QUINTIC, shifted, splines

START = np.array([0.3, -0.2, 0.5]), np.array([1.0, 0.4, -0.3]), np.array([0.2, -2.0, 0.7])
END = np.array([1.3, 0.8, -0.5]), np.array([-0.5, 0.1, 0.9]), np.array([0.6, 1.0, -1.5])


def segment(first, last, duration=0.8):
    """Samples of the segment between START and END of these degrees: function of the time since its start."""
    rows = [np.array(pair) for pair in zip(START, END, strict=True)]
    coefficients = splines(np.array([2.0, 2.0 + duration]), *rows, np.array([first, last]))[0]

    def at(t):
        powers = np.array([[t**i for i in range(6)], [i * t**max(i - 1, 0) for i in range(6)],
                           [i * (i - 1) * t**max(i - 2, 0) for i in range(6)]])
        return powers @ coefficients

    return at


@pytest.mark.parametrize("degree, agreeing", [(LINEAR, 1), (CUBIC, 2), (QUINTIC, 3)])
def test_segment_meets_both_ends_in_all_its_fields(degree, agreeing):
    at = segment(degree, degree)
    np.testing.assert_allclose(at(0.0)[:agreeing], START[:agreeing], atol=1e-12)
    np.testing.assert_allclose(at(0.8)[:agreeing], END[:agreeing], atol=1e-12)


@pytest.mark.parametrize("first, last", [(LINEAR, QUINTIC), (QUINTIC, LINEAR), (LINEAR, CUBIC), (CUBIC, LINEAR),
                                         (CUBIC, QUINTIC), (QUINTIC, CUBIC)])
def test_poorer_end_decides(first, last):
    np.testing.assert_array_equal(segment(first, last)(0.37), segment(min(first, last), min(first, last))(0.37))


def test_linear_segment_has_constant_velocity():
    at = segment(LINEAR, LINEAR)
    np.testing.assert_allclose(at(0.1)[1], (END[0] - START[0]) / 0.8)
    np.testing.assert_allclose(at(0.1)[2], 0.0)


@settings(max_examples=50, deadline=None)
@given(st.lists(st.floats(-5.0, 5.0), min_size=6, max_size=6), st.floats(0.0, 2.0), st.floats(0.0, 2.0))
def test_shifted_curve_is_the_same_curve(values, delay, t):
    coefficients = np.array(values)[None, :, None]
    powers = np.arange(6)
    later = shifted(coefficients, np.array([delay]))[0, :, 0]
    assert later @ t**powers == pytest.approx(np.array(values) @ (delay + t)**powers, rel=1e-9, abs=1e-9)


def five_points():
    """A trajectory of two joints through quintic points, and these points."""
    rng = np.random.default_rng(3)
    points = [(time, *rng.normal(size=(3, 2))) for time in (1.0, 1.5, 2.5, 3.0, 4.5)]
    current = hold(0.0, np.zeros(2))
    return replace(current, TrajectoryCommand(["a", "b"], points), 0.5, ["a", "b"],
                   np.zeros(2, dtype=bool)).trajectory, points


def test_trajectory_passes_through_its_points():
    trajectory, points = five_points()
    for time, *fields in points[:-1]:
        np.testing.assert_allclose(trajectory.sample(0.5 + time), fields, atol=1e-9)
    np.testing.assert_allclose(trajectory.sample(5.0)[0], points[-1][1], atol=1e-9)


def test_trajectory_is_smooth_where_pieces_meet():
    trajectory, points = five_points()
    for time in [0.5] + [0.5 + point[0] for point in points[:-1]]:
        np.testing.assert_allclose(trajectory.sample(time - 1e-9), trajectory.sample(time + 1e-9), atol=1e-5)


def test_rates_are_the_derivatives_of_the_position():
    trajectory, _ = five_points()
    step = 1e-5
    for time in np.arange(0.61, 4.9, 0.1):
        before, at, after = (trajectory.sample(time + delay) for delay in (-step, 0.0, step))
        np.testing.assert_allclose((after[:2] - before[:2]) / (2 * step), at[1:], rtol=1e-4, atol=1e-4)


def test_stands_still_before_the_start_and_after_the_end():
    trajectory, points = five_points()
    assert trajectory.end_time == pytest.approx(5.0)
    np.testing.assert_allclose(trajectory.sample(5.0), [points[-1][1], [0, 0], [0, 0]], atol=1e-12)
    np.testing.assert_allclose(trajectory.sample(1e6), [points[-1][1], [0, 0], [0, 0]], atol=1e-12)
    np.testing.assert_array_equal(trajectory.sample(-1.0), np.zeros((3, 2)))


def test_sample_goes_into_the_array_that_is_given():
    trajectory, _ = five_points()
    out = np.empty((3, 2))
    for time in (-1.0, 1.0):
        assert trajectory.sample(time, out) is out
        np.testing.assert_array_equal(out, trajectory.sample(time))


def test_query_before_the_start_is_refused():
    trajectory, _ = five_points()
    np.testing.assert_array_equal(trajectory.query(0.6), trajectory.sample(0.6))
    with pytest.raises(BeforeTrajectory, match="0.250000 s before"):
        trajectory.query(-0.25)


def test_hold_stands():
    trajectory = hold(2.0, [0.1, 0.2])
    for time in (1.0, 2.0, 9.0):
        np.testing.assert_array_equal(trajectory.sample(time), [[0.1, 0.2], [0, 0], [0, 0]])
    assert trajectory.end_time == 2.0


def test_stop_comes_to_rest_smoothly_within_its_duration():
    position, velocity = np.array([0.1, -0.4]), np.array([1.0, -0.5])
    trajectory = stop(3.0, position, velocity, 0.4)
    np.testing.assert_allclose(trajectory.sample(3.0), [position, velocity, [0, 0]], atol=1e-12)
    np.testing.assert_allclose(trajectory.sample(3.4)[1:], 0.0, atol=1e-12)
    np.testing.assert_allclose(trajectory.sample(3.4 - 1e-9)[1:], 0.0, atol=1e-6)
    # The mirrored quintic turns after 5/8 of what the starting velocity would have covered.
    np.testing.assert_allclose(trajectory.sample(3.4)[0], position + velocity * 0.4 * 5 / 8, atol=1e-12)


def test_stop_without_a_duration_is_a_hold():
    np.testing.assert_array_equal(stop(3.0, np.array([0.1]), np.array([1.0]), 0.0).sample(3.0), [[0.1], [0], [0]])


def test_core_loads_without_ros():
    block = "import sys; sys.modules.update(dict.fromkeys(['rospy', 'genpy', 'actionlib', 'control_msgs'])); "
    subprocess.run([sys.executable, "-c", block + "import joint_trajectory"], check=True)
