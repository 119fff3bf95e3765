# SPDX-License-Identifier: BSD-3-Clause
"""Splines through points, as the SDK's programs compute them, and the PID controller."""
import numpy as np
import pytest

from baxter_control import PID
from joint_trajectory_action import bezier

ROOM = np.random.default_rng(4).normal(size=(7, 3))


def curve_of(points, **ends):
    return bezier.bezier_coefficients(points, bezier.de_boor_control_pts(points, **ends))


@pytest.mark.parametrize("count", [2, 3, 4, 7])
@pytest.mark.parametrize("ends", [{}, {"natural": False}])
def test_curve_passes_its_points_without_a_kink(count, ends):
    points = ROOM[:count]
    control = bezier.de_boor_control_pts(points, **ends)
    assert control.shape == (count + 2, 3)
    curves = bezier.bezier_coefficients(points, control)
    assert curves.shape == (3, count - 1, 4)
    for index in range(count - 1):
        np.testing.assert_allclose(bezier.bezier_point(curves, index + 1, 0.0), points[index])
        np.testing.assert_allclose(bezier.bezier_point(curves, index + 1, 1.0), points[index + 1])
    before, after = curves[:, :-1], curves[:, 1:]
    np.testing.assert_allclose(before[:, :, 3] - before[:, :, 2], after[:, :, 1] - after[:, :, 0], atol=1e-12)
    np.testing.assert_allclose(np.diff(before, 2)[:, :, 1], np.diff(after, 2)[:, :, 0], atol=1e-12)


@pytest.mark.parametrize("count", [2, 3, 4, 7])
def test_natural_ends_have_no_curvature(count):
    curves = curve_of(ROOM[:count])
    np.testing.assert_allclose(np.diff(curves, 2)[:, [0, -1], [0, 1]], 0.0, atol=1e-12)


@pytest.mark.parametrize("count", [2, 3, 4, 7])
def test_constant_and_straight_stay_so(count):
    """With few points, too."""
    straight = np.outer(np.arange(count), [1.0, -2.0]) + 1.0
    np.testing.assert_allclose(bezier.bezier_curve(curve_of(straight), 5),
                               np.outer(np.arange(5 * (count - 1) + 1) / 5.0, [1.0, -2.0]) + 1.0)


def test_other_ends_are_at_rest_or_as_given():
    points = ROOM[:4]
    at_rest = curve_of(points, natural=False)
    np.testing.assert_allclose(at_rest[:, 0, 1], points[0])
    given = curve_of(points, d0=[1.0, 2.0, 3.0])
    np.testing.assert_allclose(given[:, 0, 1], [1.0, 2.0, 3.0])


def test_beyond_its_ends_the_curve_stays():
    curves = curve_of(ROOM)
    np.testing.assert_allclose(bezier.bezier_point(curves, 0, 0.5), ROOM[0])
    np.testing.assert_allclose(bezier.bezier_point(curves, 7, 0.5), ROOM[-1])


def test_one_point_is_no_curve():
    with pytest.raises(ValueError, match="two points or more, got 1"):
        bezier.de_boor_control_pts(ROOM[:1])


class Clock:
    now_s = 10.0

    def __call__(self):
        return self.now_s


def test_pid_terms():
    clock = Clock()
    pid = PID(2.0, 3.0, 0.5, now=clock)
    assert pid.compute_output(1.0) == pytest.approx(2.0)
    clock.now_s += 0.1
    assert pid.compute_output(1.2) == pytest.approx(2.0 * 1.2 + 3.0 * 0.12 + 0.5 * 2.0)
    pid.initialize()
    assert pid.compute_output(1.2) == pytest.approx(2.4)


def test_pid_gains_can_be_changed_and_a_clock_that_stands_or_goes_back_does_no_harm():
    clock = Clock()
    pid = PID(now=clock)
    pid.set_kp(1.0)
    pid.set_ki(10.0)
    pid.set_kd(100.0)
    pid.compute_output(0.0)
    assert pid.compute_output(1.0) == pytest.approx(1.0)
    clock.now_s = 3.0
    assert pid.compute_output(2.0) == pytest.approx(2.0)
