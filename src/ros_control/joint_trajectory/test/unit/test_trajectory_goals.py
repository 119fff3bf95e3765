# SPDX-License-Identifier: BSD-3-Clause
"""Tolerances and verdicts: when a goal is reached, and when it is missed."""
import math

import numpy as np
import pytest

from joint_trajectory import (
    AllPointsInPast,
    Follower,
    GoalMonitor,
    GoalOutcome,
    MissingJoints,
    Tolerances,
    TrajectoryCommand,
    bounds,
    merge_tolerances,
)

NAMES = ["a", "b"]
NOBODY = np.zeros(2)
DEFAULTS = Tolerances(bounds(2, position=[0.1, 0.0]), bounds(2, position=0.02, velocity=0.01), 0.5)


# -- tolerances -----------------------------------------------------------------------------------------------------

def test_bounds_of_zero_do_not_bind():
    np.testing.assert_array_equal(bounds(2, [0.1, 0.0], 0.01), [[0.1, np.inf], [0.01, 0.01], [np.inf, np.inf]])


def test_positive_replaces_negative_clears_zero_keeps():
    merged = merge_tolerances(DEFAULTS, NAMES, path=[("b", 0.3, 0.0, 0.0), ("a", -1.0, 0.7, 0.0)],
                              goal=[("b", 0.0, -1.0, 2.0)])
    np.testing.assert_array_equal(merged.path, [[np.inf, 0.3], [0.7, np.inf], [np.inf, np.inf]])
    np.testing.assert_array_equal(merged.goal, [[0.02, 0.02], [0.01, np.inf], [np.inf, 2.0]])


def test_merging_makes_a_new_table():
    before = DEFAULTS.path.copy(), DEFAULTS.goal.copy()
    merge_tolerances(DEFAULTS, NAMES, path=[("a", 9.0, 9.0, 9.0)], goal=[("a", 9.0, 9.0, 9.0)], goal_time_s=9.0)
    np.testing.assert_array_equal(DEFAULTS.path, before[0])
    np.testing.assert_array_equal(DEFAULTS.goal, before[1])
    assert DEFAULTS.goal_time_s == 0.5


def test_tolerances_of_other_joints_and_those_that_are_no_numbers_change_nothing():
    merged = merge_tolerances(DEFAULTS, NAMES, path=[("x", 9.0, 9.0, 9.0), ("a", math.nan, 0.0, 0.0)])
    np.testing.assert_array_equal(merged.path, DEFAULTS.path)


@pytest.mark.parametrize("asked, expected", [(2.0, 2.0), (0.0, 0.5), (-1.0, 0.0)])
def test_goal_time(asked, expected):
    assert merge_tolerances(DEFAULTS, NAMES, goal_time_s=asked).goal_time_s == expected


# -- verdicts -------------------------------------------------------------------------------------------------------

def error(position=(0.0, 0.0), velocity=(0.0, 0.0)):
    return np.array([position, velocity, (0.0, 0.0)])


def monitor(begins=(1.0, 1.0), ends=(3.0, 3.0), tolerances=DEFAULTS):
    return GoalMonitor(NAMES, tolerances, np.array(begins), np.array(ends))


def test_path_violation_names_joint_error_tolerance_and_time():
    verdict = monitor().check(2.5, error((-0.2, 0.0)))
    assert verdict.outcome is GoalOutcome.PATH_TOLERANCE_VIOLATED
    assert (verdict.joint, verdict.quantity, verdict.error, verdict.tolerance) == ("a", "position", -0.2, 0.1)
    assert verdict.text == "a path error -0.200000 (position, tolerance 0.1) at 1.500 s"


def test_error_on_the_tolerance_is_within():
    assert monitor().check(2.0, error((0.1, 0.0))) is None


def test_joint_without_a_path_tolerance_may_be_anywhere():
    assert monitor().check(2.0, error((0.0, 100.0))) is None


def test_velocity_on_the_path_is_bound_only_if_asked():
    assert monitor().check(2.0, error(velocity=(9.0, 9.0))) is None
    strict = merge_tolerances(DEFAULTS, NAMES, path=[("b", 0.0, 0.5, 0.0)])
    verdict = monitor(tolerances=strict).check(2.0, error(velocity=(9.0, 9.0)))
    assert (verdict.joint, verdict.quantity) == ("b", "velocity")


def test_nothing_is_watched_before_the_goal_begins():
    assert monitor().check(0.999, error((9.0, 9.0))) is None


def test_success_on_the_first_check_after_the_end():
    watch = monitor()
    assert watch.check(2.999, error()) is None
    assert watch.check(3.0, error((0.01, -0.01))).outcome is GoalOutcome.SUCCEEDED


def test_success_has_no_text():
    assert monitor().check(3.0, error()).text == ""


def test_goal_may_be_reached_late_within_the_goal_time():
    watch = monitor()
    assert watch.check(3.2, error((0.05, 0.0))) is None
    assert watch.check(3.4999, error((0.05, 0.0))) is None
    assert watch.check(3.4999, error()).outcome is GoalOutcome.SUCCEEDED


def test_goal_violation_after_the_goal_time():
    watch = monitor()
    assert watch.check(3.25, error((0.0, 0.3))) is None
    verdict = watch.check(3.5, error((0.0, 0.3)))
    assert verdict.outcome is GoalOutcome.GOAL_TOLERANCE_VIOLATED
    assert verdict.text == "b goal error 0.300000 (position, tolerance 0.02) 0.500 s after the end"


def test_without_a_goal_time_the_first_check_decides():
    strict = merge_tolerances(DEFAULTS, NAMES, goal_time_s=-1.0)
    verdict = monitor(tolerances=strict).check(3.0, error((0.0, 0.3)))
    assert verdict.outcome is GoalOutcome.GOAL_TOLERANCE_VIOLATED


def test_joint_that_still_moves_has_not_arrived():
    verdict = monitor().check(3.5, error(velocity=(0.02, 0.0)))
    assert (verdict.outcome, verdict.quantity) == (GoalOutcome.GOAL_TOLERANCE_VIOLATED, "velocity")


def test_path_tolerance_does_not_bind_after_the_end():
    assert monitor().check(3.1, error((0.2, 0.0))) is None


def test_joint_that_was_there_once_counts_as_arrived():
    watch = monitor()
    assert watch.check(3.1, error((0.0, 0.3))) is None
    assert watch.check(3.2, error((0.3, 0.0))).outcome is GoalOutcome.SUCCEEDED


def test_joints_with_their_own_times_are_each_in_their_own_phase():
    watch = monitor(begins=(1.0, 2.0), ends=(3.0, 5.0), tolerances=Tolerances(bounds(2, 0.1), bounds(2, 0.02), 0.5))
    assert watch.check(1.5, error((0.0, 9.0))) is None
    assert watch.check(3.1, error()) is None
    assert watch.check(4.5, error((0.05, 0.05))) is None
    assert watch.check(5.0, error()).outcome is GoalOutcome.SUCCEEDED
    late = monitor(begins=(1.0, 2.0), ends=(3.0, 5.0), tolerances=Tolerances(bounds(2, 0.1), bounds(2, 0.02), 0.5))
    assert late.check(4.0, error((0.05, 0.05))).joint == "a"
    assert late.check(4.0, error((0.0, 0.2))).outcome is GoalOutcome.PATH_TOLERANCE_VIOLATED


@pytest.mark.parametrize("time, outcome", [(2.0, GoalOutcome.PATH_TOLERANCE_VIOLATED),
                                           (4.0, GoalOutcome.GOAL_TOLERANCE_VIOLATED)])
def test_position_that_is_no_number_is_beyond_every_tolerance(time, outcome):
    assert monitor().check(time, error((math.nan, 0.0))).outcome is outcome


# -- the follower -----------------------------------------------------------------------------------------------------

def follower(**options):
    started = Follower(NAMES, **options)
    started.start(0.0, NOBODY, NOBODY)
    return started


def go(names=NAMES, to=(1.0, 2.0), after=1.0):
    return TrajectoryCommand(names, [(after, to, [], [])])


def test_starts_by_standing():
    arm = Follower(NAMES)
    arm.start(0.0, np.array([0.3, 0.4]), np.array([1.0, 1.0]))
    assert arm.update(5.0, np.array([0.3, 0.4]), NOBODY) is None
    np.testing.assert_array_equal(arm.desired, [[0.3, 0.4], [0, 0], [0, 0]])


def test_goal_is_followed_and_reached():
    arm = follower()
    arm.accept(go(), 0.002, NOBODY, goal="g", tolerances=DEFAULTS)
    assert arm.goal == "g"
    assert arm.update(0.502, np.array([0.5, 1.0]), np.array([1.0, 2.0])) is None
    np.testing.assert_allclose(arm.desired, [[0.5, 1.0], [1.0, 2.0], [0, 0]])
    np.testing.assert_allclose(arm.error, 0.0, atol=1e-12)
    assert arm.update(1.002, np.array([1.0, 2.0]), NOBODY).outcome is GoalOutcome.SUCCEEDED
    assert arm.update(1.004, np.array([1.0, 2.0]), NOBODY) is None


def test_joints_go_on_after_a_violation():
    arm = follower()
    arm.accept(go(), 0.0, NOBODY, goal="g", tolerances=DEFAULTS)
    assert arm.update(0.5, NOBODY, NOBODY).outcome is GoalOutcome.PATH_TOLERANCE_VIOLATED
    assert arm.update(0.6, NOBODY, NOBODY) is None
    np.testing.assert_allclose(arm.desired[0], [0.6, 1.2])


def test_commands_without_a_goal_are_not_watched():
    arm = follower()
    arm.accept(go(), 0.0, NOBODY)
    for time in (0.5, 1.0, 3.0):
        assert arm.update(time, np.array([9.0, 9.0]), NOBODY) is None


def test_new_goal_takes_the_place_of_the_old():
    arm = follower()
    arm.accept(go(), 0.0, NOBODY, goal="old", tolerances=DEFAULTS)
    arm.accept(go(to=(0.0, 0.0)), 0.5, NOBODY, goal="new", tolerances=DEFAULTS)
    assert arm.goal == "new"
    assert arm.update(1.5, NOBODY, NOBODY).outcome is GoalOutcome.SUCCEEDED


def test_refused_command_changes_nothing():
    arm = follower()
    arm.accept(go(), 0.0, NOBODY, goal="old", tolerances=DEFAULTS)
    for command, cause in ((go(names=["a"], to=[5.0]), MissingJoints), (go(after=0.0), AllPointsInPast)):
        with pytest.raises(cause):
            arm.accept(command, 0.5, NOBODY, goal="new", tolerances=DEFAULTS)
    assert arm.goal == "old"
    arm.update(0.5, np.array([0.5, 1.0]), NOBODY)
    np.testing.assert_allclose(arm.desired[0], [0.5, 1.0])


def test_no_points_stop_where_the_joints_are_and_the_goal_is_reached():
    arm = follower()
    arm.accept(go(), 0.0, NOBODY)
    arm.accept(TrajectoryCommand(NAMES, []), 0.5, np.array([0.4, 0.9]), goal="stop", tolerances=DEFAULTS)
    verdict = arm.update(0.502, np.array([0.4, 0.9]), np.array([1.0, 1.0]))
    assert verdict.outcome is GoalOutcome.SUCCEEDED
    np.testing.assert_array_equal(arm.desired, [[0.4, 0.9], [0, 0], [0, 0]])


def test_stop_with_a_duration_is_smooth_and_reached_at_its_end():
    arm = follower(stop_duration_s=0.5)
    arm.accept(go(to=(10.0, 20.0), after=10.0), 0.0, NOBODY)
    arm.stop(2.0, NOBODY, goal="stop")
    assert arm.update(2.0, NOBODY, NOBODY) is None
    np.testing.assert_allclose(arm.desired, [[2.0, 4.0], [1.0, 2.0], [0, 0]])
    assert arm.update(2.499, NOBODY, NOBODY) is None
    assert arm.update(2.5, NOBODY, NOBODY).outcome is GoalOutcome.SUCCEEDED
    np.testing.assert_allclose(arm.desired[1:], 0.0, atol=1e-12)


def test_start_comes_to_rest_from_the_measured_velocity():
    arm = Follower(NAMES, stop_duration_s=0.5)
    arm.start(0.0, np.array([0.1, 0.2]), np.array([1.0, 0.0]))
    arm.update(0.0, NOBODY, NOBODY)
    np.testing.assert_allclose(arm.desired, [[0.1, 0.2], [1.0, 0.0], [0, 0]])


def test_what_was_looked_at_ahead_is_what_comes():
    arm = follower()
    arm.accept(go(), 0.0, NOBODY)
    ahead = arm.look_ahead(0.25).copy()
    arm.update(0.25, NOBODY, NOBODY)
    np.testing.assert_array_equal(arm.desired, ahead)
    np.testing.assert_allclose(ahead[0], [0.25, 0.5])


def test_command_after_a_look_ahead_counts():
    arm = follower()
    arm.look_ahead(0.25)
    arm.accept(go(), 0.0, NOBODY)
    arm.update(0.25, NOBODY, NOBODY)
    np.testing.assert_allclose(arm.desired[0], [0.25, 0.5])


def test_release_forgets_the_goal_but_not_the_way():
    arm = follower()
    arm.accept(go(), 0.0, NOBODY, goal="g", tolerances=DEFAULTS)
    arm.release()
    assert arm.goal is None
    assert arm.update(0.5, NOBODY, NOBODY) is None
    np.testing.assert_allclose(arm.desired[0], [0.5, 1.0])


@pytest.mark.parametrize("desired, actual, expected", [(3.0, -3.0, 6.0 - 2 * math.pi), (0.0, 4 * math.pi, 0.0),
                                                       (1.0, 0.5, 0.5)])
def test_position_error_is_the_shorter_way_round(desired, actual, expected):
    arm = follower()
    arm.stop(0.1, np.array([desired, desired]))
    arm.update(0.1, np.array([actual, actual]), NOBODY)
    np.testing.assert_allclose(arm.error[0], expected, atol=1e-12)


def test_partial_goal_watches_the_other_joints_too():
    arm = follower(allow_partial=True)
    arm.accept(go(), 0.0, NOBODY)
    tolerances = Tolerances(bounds(2, position=0.1), bounds(2), 0.0)
    arm.accept(go(names=["b"], to=[0.0], after=2.0), 0.5, NOBODY, goal="part", tolerances=tolerances)
    verdict = arm.update(0.75, np.array([0.0, 0.875]), NOBODY)
    assert (verdict.outcome, verdict.joint) == (GoalOutcome.PATH_TOLERANCE_VIOLATED, "a")


def test_partial_goal_is_reached_when_every_joint_has_arrived():
    arm = follower(allow_partial=True)
    arm.accept(go(), 0.0, NOBODY)
    arm.accept(go(names=["b"], to=[0.0], after=2.0), 0.5, NOBODY, goal="part", tolerances=DEFAULTS)
    there = np.array([1.0, 0.0])
    assert arm.update(1.2, there, NOBODY) is None
    assert arm.update(2.5, there, NOBODY).outcome is GoalOutcome.SUCCEEDED
