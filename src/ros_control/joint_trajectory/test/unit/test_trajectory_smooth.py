# SPDX-License-Identifier: BSD-3-Clause
"""Smooth curves between points, and limits of a trajectory."""
import numpy as np
import pytest

from joint_trajectory import (
    BeyondPosition,
    BeyondVelocity,
    Follower,
    Limits,
    TrajectoryCommand,
    replace,
    smooth_velocities,
)
from joint_trajectory.trajectory import hold

NAMES = ["a", "b"]
NO_TURNS = np.zeros(2, dtype=bool)


def smooth(points, now=0.5, current=None, start_time=None):
    current = hold(0.0, np.zeros(2)) if current is None else current
    return replace(current, TrajectoryCommand(NAMES, points, start_time), now, NAMES, NO_TURNS, smooth=True).trajectory


def samples(trajectory, begin, end, count=2001):
    times = np.linspace(begin, end, count)
    return times, np.array([trajectory.sample(t) for t in times])


def test_points_without_velocities_are_joined_without_kinks_or_overshoot():
    places = [1.0, 1.5, 1.5, -0.5]
    trajectory = smooth([(i + 1.0, [p, -p], [], []) for i, p in enumerate(places)])
    times, states = samples(trajectory, 0.5, 5.0)
    jumps = np.abs(np.diff(states[:, 1], axis=0))
    assert jumps.max() < 0.05, "the velocity jumps by %g rad/s" % jumps.max()
    assert states[:, 0].max() <= 1.5 + 1e-12 and states[:, 0].min() >= -1.5 - 1e-12
    for i, p in enumerate(places):
        np.testing.assert_allclose(trajectory.sample(0.5 + i + 1.0)[0], [p, -p], atol=1e-12)
    np.testing.assert_allclose(states[-1, 1:], 0.0, atol=1e-12)


def test_velocities_that_are_given_are_passed_and_the_others_found():
    trajectory = smooth([(1.0, [1.0, 0.0], [0.7, -0.2], []), (2.0, [2.0, 0.0], [], []), (3.0, [3.0, 0.0], [], [])])
    np.testing.assert_allclose(trajectory.sample(1.5)[1], [0.7, -0.2], atol=1e-12)
    assert trajectory.sample(2.5)[1, 0] == pytest.approx(1.0)


def test_accelerations_that_are_given_are_passed():
    trajectory = smooth([(1.0, [1.0, 0.0], [0.7, 0.0], [0.3, -0.4]), (2.0, [2.0, 0.0], [0.0, 0.0], [0.0, 0.0])])
    np.testing.assert_allclose(trajectory.sample(1.5)[2], [0.3, -0.4], atol=1e-12)


def test_the_last_point_is_one_of_rest_whatever_it_says():
    trajectory = smooth([(1.0, [1.0, 0.0], [0.7, 0.7], [5.0, 5.0])])
    just_before = trajectory.sample(1.5 - 1e-9)
    np.testing.assert_allclose(just_before[1:], 0.0, atol=1e-6)


def test_a_first_point_due_at_the_start_is_where_the_joints_are():
    """Also when the start is in the future: nothing may jump there."""
    trajectory = smooth([(0.0, [0.3, 0.3], [], []), (2.0, [1.0, 1.0], [], [])], start_time=3.0)
    _, states = samples(trajectory, 2.9, 3.1)
    assert np.abs(np.diff(states[:, 0], axis=0)).max() < 1e-3
    np.testing.assert_allclose(trajectory.sample(5.0)[0], 1.0)


def test_a_replacement_in_flight_starts_with_the_velocity_at_hand():
    first = smooth([(2.0, [1.0, 0.0], [], [])])
    second = smooth([(1.0, [0.0, 0.5], [], [])], now=1.5, current=first)
    np.testing.assert_allclose(second.sample(1.5)[:2], first.sample(1.5)[:2], atol=1e-9)


def test_smooth_velocities_of_a_straight_way_are_its_slope():
    velocities = smooth_velocities(np.array([0.0, 1.0, 3.0]), np.array([[0.0], [2.0], [6.0]]))
    np.testing.assert_allclose(velocities, [[0.0], [2.0], [0.0]])


def test_smooth_velocities_do_not_divide_by_zero():
    positions = np.array([[0.0, 1.0], [0.0, 0.0], [0.0, 1.0], [0.0, 2.0]])
    assert smooth_velocities(np.arange(4.0), positions).tolist() == [[0, 0], [0, 0], [0, 1], [0, 0]]


# -- limits ---------------------------------------------------------------------------------------------------------

def follower(start=(0.0, 0.0), slack=0.01, **options):
    made = Follower(NAMES, smooth=True, limits=Limits(NAMES, [-1.0, -2.0], [1.0, 2.0], [1.5, 4.0], slack), **options)
    made.start(0.0, np.array(start), np.zeros(2))
    return made


def accept(points, **options):
    made = follower(**options)
    before = made.trajectory
    try:
        made.accept(TrajectoryCommand(NAMES, points), 0.25, np.zeros(2), goal="goal")
    except BaseException:
        assert made.trajectory is before and made.goal is None
        raise


@pytest.mark.parametrize("place", [1.005, -1.005])
def test_within_the_limits_and_their_slack(place):
    accept([(2.0, [place, 0.0], [], [])])


@pytest.mark.parametrize("place, limit", [(1.02, 1.0), (-1.02, -1.0)])
def test_beyond_a_position_limit_names_joint_value_limit_and_time(place, limit):
    with pytest.raises(BeyondPosition) as caught:
        accept([(2.0, [0.5, 0.0], [], []), (4.0, [place, 0.0], [], [])])
    assert str(caught.value) == "a would have to be at %f at 4.000 s; its limit is %f" % (place, limit)


def test_beyond_a_limit_between_the_points():
    """The points are within, but with the given velocities the curve leaves the limits between them."""
    with pytest.raises(BeyondPosition):
        accept([(2.0, [0.9, 0.0], [1.4, 0.0], []), (4.0, [0.9, 0.0], [], [])])


def test_too_fast_names_joint_velocity_limit_and_time():
    with pytest.raises(BeyondVelocity) as caught:
        accept([(2.0, [0.5, 0.0], [], []), (2.5, [0.5, -2.0], [], []), (2.6, [-0.5, -2.0], [], [])])
    assert str(caught.value) == "a would have to move at 10.000000 per s from 2.500 s on; its limit is 1.500000 per s"


def test_too_fast_to_the_first_point():
    with pytest.raises(BeyondVelocity):
        accept([(0.1, [0.9, 0.0], [], [])])


def test_a_joint_that_is_out_may_come_back_but_go_no_farther():
    accept([(2.0, [1.05, 0.0], [], [])], start=(1.1, 0.0))
    with pytest.raises(BeyondPosition):
        accept([(2.0, [1.2, 0.0], [], [])], start=(1.1, 0.0))


def test_joints_that_a_partial_command_leaves_out_are_no_hindrance():
    made = follower(allow_partial=True)
    made.accept(TrajectoryCommand(["b"], [(1.0, [1.0], [], [])]), 0.25, np.zeros(2))
    assert made.trajectory.sample(2.0)[0].tolist() == [0.0, 1.0]
