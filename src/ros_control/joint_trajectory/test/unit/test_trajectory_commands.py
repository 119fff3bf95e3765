# SPDX-License-Identifier: BSD-3-Clause
"""Valid commands, and how a command replaces the previous trajectory."""
import math

import numpy as np
import pytest

import joint_trajectory
from joint_trajectory import TrajectoryCommand, TrajectoryError, hold, joint_indices, replace

NAMES = ["a", "b", "c"]
NO_TURNS = np.zeros(3, dtype=bool)


def linear(*points, names=NAMES, start_time=None):
    """A command of (time, positions) points."""
    return TrajectoryCommand(names, [(time, positions, [], []) for time, positions in points], start_time)


def moving():
    """Joint i moves at i + 1 rad/s from t = 0 to t = 10."""
    speeds = np.array([1.0, 2.0, 3.0])
    return replace(hold(0.0, np.zeros(3)), linear((10.0, 10.0 * speeds)), 0.0, NAMES, NO_TURNS).trajectory


# -- joint names --------------------------------------------------------------------------------------------------

def test_any_order_of_the_joints_will_do():
    np.testing.assert_array_equal(joint_indices(["c", "a", "b"], NAMES), [2, 0, 1])
    trajectory = replace(hold(0.0, np.zeros(3)), linear((1.0, [3.0, 1.0, 2.0]), names=["c", "a", "b"]), 0.0, NAMES,
                         NO_TURNS).trajectory
    np.testing.assert_allclose(trajectory.sample(2.0)[0], [1.0, 2.0, 3.0])


@pytest.mark.parametrize("names, error, text", [
    ([], "NoJointNames", "joint_names is empty, expected a, b, c"),
    (["a", "b", "x"], "UnknownJoints", "unknown joint x, expected a, b, c"),
    (["a", "b", "b"], "RepeatedJoints", "b more than once"),
    (["a", "c"], "MissingJoints", "lacks b;"),
])
def test_wrong_joint_names_are_refused(names, error, text):
    with pytest.raises(getattr(joint_trajectory, error), match=text) as caught:
        joint_indices(names, NAMES)
    assert isinstance(caught.value, joint_trajectory.JointNamesError)


def test_a_part_of_the_joints_is_enough_only_where_that_is_allowed():
    np.testing.assert_array_equal(joint_indices(["c", "a"], NAMES, allow_partial=True), [2, 0])
    with pytest.raises(joint_trajectory.NoJointNames):
        joint_indices([], NAMES, allow_partial=True)
    with pytest.raises(joint_trajectory.UnknownJoints):
        joint_indices(["x"], NAMES, allow_partial=True)


# -- points -------------------------------------------------------------------------------------------------------

P, BAD = [0.0, 0.0, 0.0], [0.0, math.nan, 0.0]


@pytest.mark.parametrize("points, error, text", [
    ([(1.0, [], P, P)], "NoPositions", "point 0 has no positions"),
    ([(1.0, P, [], []), (2.0, P[:2], [], [])], "WrongSize", "point 1 has 2 positions, expected 3$"),
    ([(1.0, P, [0.0], [])], "WrongSize", "point 0 has 1 velocity, expected 3 or none"),
    ([(1.0, P, P, [0.0] * 4)], "WrongSize", "point 0 has 4 accelerations, expected 3 or none"),
    ([(1.0, P, [], []), (1.0, P, [], [])], "TimesNotIncreasing", "point 1 has 1 s after 1 s"),
    ([(1.0, P, [], []), (2.0, P, [], []), (1.5, P, [], [])], "TimesNotIncreasing", "point 2 has 1.5 s after 2 s"),
    ([(math.nan, P, [], [])], "NotFinite", "point 0 has time_from_start"),
    ([(1.0, P, [], []), (2.0, BAD, [], [])], "NotFinite", "point 1 has positions"),
    ([(1.0, P, BAD, [])], "NotFinite", "point 0 has velocities"),
    ([(1.0, P, P, [math.inf] * 3)], "NotFinite", "point 0 has accelerations"),
])
def test_wrong_points_are_refused(points, error, text):
    with pytest.raises(getattr(joint_trajectory, error), match=text) as caught:
        TrajectoryCommand(NAMES, points)
    assert isinstance(caught.value, TrajectoryError)


def test_accelerations_without_velocities_do_not_count():
    trajectory = replace(hold(0.0, np.zeros(3)), TrajectoryCommand(NAMES, [(1.0, [1.0] * 3, [], [9.0] * 3)]), 0.0,
                         NAMES, NO_TURNS).trajectory
    np.testing.assert_allclose(trajectory.sample(0.5), [[0.5] * 3, [1.0] * 3, P])


def test_one_point_may_have_any_time_above_now():
    assert replace(hold(0.0, np.zeros(3)), linear((1e-3, P)), 0.0, NAMES, NO_TURNS).dropped == 0


# -- start times and late points ------------------------------------------------------------------------------------

def test_without_a_start_time_it_begins_now():
    replacement = replace(moving(), linear((1.0, P), (2.0, P)), 4.0, NAMES, NO_TURNS)
    np.testing.assert_allclose(replacement.trajectory.sample(4.0)[0], [4.0, 8.0, 12.0])
    np.testing.assert_allclose(replacement.trajectory.sample(4.5)[0], [2.0, 4.0, 6.0])
    np.testing.assert_allclose(replacement.trajectory.end_times, 6.0)
    np.testing.assert_array_equal(replacement.begins, 4.0)


def test_future_start_keeps_the_old_trajectory_until_then():
    replacement = replace(moving(), linear((1.0, P), start_time=6.0), 4.0, NAMES, NO_TURNS)
    for time in (4.0, 5.0, 5.999):
        np.testing.assert_allclose(replacement.trajectory.sample(time)[0], np.array([1.0, 2.0, 3.0]) * time)
    np.testing.assert_allclose(replacement.trajectory.sample(6.5)[0], [3.0, 6.0, 9.0])
    np.testing.assert_array_equal(replacement.begins, 6.0)


def test_between_the_end_of_the_old_and_a_future_start_it_stands():
    replacement = replace(moving(), linear((1.0, P), start_time=20.0), 4.0, NAMES, NO_TURNS)
    np.testing.assert_allclose(replacement.trajectory.sample(15.0), [[10.0, 20.0, 30.0], P, P])
    np.testing.assert_allclose(replacement.trajectory.sample(20.5)[0], [5.0, 10.0, 15.0])


def test_bridge_begins_with_the_state_of_the_old_trajectory():
    command = TrajectoryCommand(NAMES, [(2.0, P, P, P)])
    trajectory = replace(moving(), command, 4.0, NAMES, NO_TURNS).trajectory
    np.testing.assert_allclose(trajectory.sample(4.0), [[4.0, 8.0, 12.0], [1.0, 2.0, 3.0], P], atol=1e-12)
    np.testing.assert_allclose(trajectory.sample(6.0), [P, P, P], atol=1e-12)


@pytest.mark.parametrize("fields, velocity_goes_on", [((P, [], []), False), ((P, P, []), True), ((P, P, P), True)])
def test_first_point_decides_the_degree_of_the_bridge(fields, velocity_goes_on):
    trajectory = replace(moving(), TrajectoryCommand(NAMES, [(2.0, *fields)]), 4.0, NAMES, NO_TURNS).trajectory
    expected = [1.0, 2.0, 3.0] if velocity_goes_on else [-2.0, -4.0, -6.0]
    np.testing.assert_allclose(trajectory.sample(4.0)[1], expected, atol=1e-12)


def test_late_points_are_left_out_and_counted():
    replacement = replace(moving(), linear((1.0, P), (2.0, P), (3.0, [7.0] * 3), start_time=2.0), 4.5, NAMES, NO_TURNS)
    assert replacement.dropped == 2
    assert replacement.late_s == pytest.approx(1.5)
    np.testing.assert_allclose(replacement.trajectory.sample(4.75)[0], (np.array([4.5, 9.0, 13.5]) + 7.0) / 2)


def test_first_point_at_once_gives_way_to_the_present_state():
    replacement = replace(moving(), linear((0.0, [99.0] * 3), (1.0, P)), 4.0, NAMES, NO_TURNS)
    assert (replacement.dropped, replacement.late_s) == (1, 0.0)
    np.testing.assert_allclose(replacement.trajectory.sample(4.0)[0], [4.0, 8.0, 12.0])


def test_command_that_lies_in_the_past_is_refused():
    with pytest.raises(joint_trajectory.AllPointsInPast, match=r"all points \(2\) .* the last one by 1.500000 s"):
        replace(moving(), linear((1.0, P), (2.0, P), start_time=1.0), 4.5, NAMES, NO_TURNS)


def test_only_point_at_once_is_refused_with_advice():
    with pytest.raises(joint_trajectory.AllPointsInPast, match="time_from_start above 0"):
        replace(moving(), linear((0.0, P)), 4.0, NAMES, NO_TURNS)


def test_point_at_a_future_start_is_not_late():
    trajectory = replace(moving(), linear((0.0, [5.0] * 3), (1.0, P), start_time=6.0), 4.0, NAMES, NO_TURNS).trajectory
    np.testing.assert_allclose(trajectory.sample(6.0)[0], [5.0] * 3)
    np.testing.assert_allclose(trajectory.sample(6.5)[0], [2.5] * 3)


def test_pieces_that_have_passed_are_forgotten():
    trajectory = moving()
    for now in np.arange(0.1, 50.0, 0.1):
        trajectory = replace(trajectory, linear((0.2, P), (0.4, P)), now, NAMES, NO_TURNS).trajectory
    assert len(trajectory.starts) <= 5


# -- a part of the joints -------------------------------------------------------------------------------------------

def test_joints_that_are_not_named_stay_on_their_way():
    old = moving()
    replacement = replace(old, linear((1.0, [0.0]), (3.0, [6.0]), names=["b"]), 4.0, NAMES, NO_TURNS, True)
    for time in (4.0, 4.3, 5.0, 6.5, 7.0, 9.0, 12.0):
        before, after = (trajectory.sample(time)[:, [0, 2]] for trajectory in (old, replacement.trajectory))
        np.testing.assert_allclose(after, before, atol=1e-12)
    np.testing.assert_allclose(replacement.trajectory.sample(4.5)[0, 1], 4.0)
    np.testing.assert_allclose(replacement.trajectory.sample(8.0)[:, 1], [6.0, 0.0, 0.0])
    np.testing.assert_allclose(replacement.trajectory.end_times, [10.0, 7.0, 10.0])


def test_partial_command_with_a_future_start_begins_for_its_joints_only():
    replacement = replace(moving(), linear((1.0, [0.0]), names=["b"], start_time=6.0), 4.0, NAMES, NO_TURNS, True)
    np.testing.assert_array_equal(replacement.begins, [4.0, 6.0, 4.0])
    np.testing.assert_allclose(replacement.trajectory.sample(5.0)[0], [5.0, 10.0, 15.0])
    np.testing.assert_allclose(replacement.trajectory.sample(6.5)[0], [6.5, 6.0, 19.5])


def test_quintics_cut_by_partial_commands_stay_what_they_are():
    rng = np.random.default_rng(1)
    old = replace(hold(0.0, np.zeros(3)),
                  TrajectoryCommand(NAMES, [(t, *rng.normal(size=(3, 3))) for t in (1.0, 2.0, 4.0)]), 0.0,
                  NAMES, NO_TURNS).trajectory
    cut = old
    for now in (0.3, 0.7, 1.4, 2.2):
        cut = replace(cut, linear((0.33, [0.0]), (0.77, [1.0]), names=["a"]), now, NAMES, NO_TURNS, True).trajectory
    for time in np.linspace(2.2, 5.0, 50):
        np.testing.assert_allclose(cut.sample(time)[:, 1:], old.sample(time)[:, 1:], atol=1e-9)


# -- continuous joints -----------------------------------------------------------------------------------

@pytest.mark.parametrize("position, target, expected", [
    (0.0, 1.0, 1.0),
    (3.0, -3.0, 2 * math.pi - 3.0),
    (-3.0, 3.0, 3.0 - 2 * math.pi),
    (20.0, 0.5, 0.5 + 6 * math.pi),
    (-20.0, 0.5, 0.5 - 6 * math.pi),
    (0.0, math.pi, math.pi),
    (0.0, -math.pi, -math.pi),
    (0.0, 3 * math.pi, math.pi),
    (0.0, -3 * math.pi, -math.pi),
    (math.pi, -math.pi / 2, 1.5 * math.pi),
])
def test_continuous_joint_takes_the_shorter_way(position, target, expected):
    turning = np.array([True, False, False])
    here = np.array([position, position, position])
    there = [target] * 3
    trajectory = replace(hold(0.0, here), linear((1.0, there)), 0.0, NAMES, turning).trajectory
    np.testing.assert_allclose(trajectory.sample(2.0)[0], [expected, target, target])


def test_whole_trajectory_of_a_continuous_joint_is_shifted_alike():
    trajectory = replace(hold(0.0, np.array([10.0, 0.0, 0.0])), linear((1.0, P), (2.0, [4.0, 4.0, 4.0])), 0.0, NAMES,
                         np.array([True, False, False])).trajectory
    np.testing.assert_allclose(trajectory.sample(1.0)[0, 0], 4 * math.pi)
    np.testing.assert_allclose(trajectory.sample(3.0)[0], [4 * math.pi + 4.0, 4.0, 4.0])
