# SPDX-License-Identifier: BSD-3-Clause
"""The limitations that the notes list: each lifted, and each switched back by config/as_in_notes.yaml."""
import pathlib
import sys

import numpy as np
import pytest

from baxter_traj_streamer.errors import GoalRefused
from baxter_traj_streamer.judging import KNOWN_JOINTS, RIGHT_ARM, StreamedJointLimit, judge

sys.path.insert(0, str(pathlib.Path(__file__).parents[1]))
from streamer_settings import AS_IN_NOTES, DEFAULTS, make_settings  # noqa: E402

LIMITS = {name: StreamedJointLimit(-2.0, 2.0, 1.5) for name in KNOWN_JOINTS}
AT_ZERO = dict.fromkeys(KNOWN_JOINTS, 0.0)
ARM = [0.0] * 7


def plan_for(points, names=("right_s0", "left_w2"), **settings):
    rows = [(*point, *[[]] * (4 - len(point))) for point in points]
    return judge(names, rows, LIMITS, AT_ZERO, make_settings(**settings))


def reason(points, *arguments, **settings):
    with pytest.raises(GoalRefused) as caught:
        plan_for(points, *arguments, **settings)
    return caught.value.reason


def moved(index, value):
    return [value if i == index else 0.0 for i in range(7)]


def test_all_switches_of_the_notes_are_settings_and_differ_from_ours():
    assert all(DEFAULTS[name] != value for name, value in AS_IN_NOTES.items())
    make_settings(**AS_IN_NOTES)


# -- interpolation ----------------------------------------------------------------------------------------------------

def test_degree_follows_the_fields_that_are_given():
    cubic = plan_for([(1.0, [0.3, 0.0], [0.2, 0.0]), (2.0, [0.5, 0.0], [0.0, 0.0])]).trajectory
    assert cubic.sample(1.0)[1] == pytest.approx([0.2, 0.0])
    full = [(1.0, [0.3, 0.0], [0.2, 0.0], [0.1, 0.0]), (2.0, [0.5, 0.0], [0.0, 0.0], [0.0, 0.0])]
    assert plan_for(full).trajectory.sample(1.0)[2] == pytest.approx([0.1, 0.0])
    assert not plan_for(full, interpolation="cubic").trajectory.coefficients[:, 4:].any()


def test_a_point_without_velocities_among_others_makes_no_corner():
    trajectory = plan_for([(1.0, [0.3, 0.0], [0.2, 0.0]), (2.0, [0.5, 0.0]), (3.0, [0.8, 0.0], [0.0, 0.0])]).trajectory
    before, after = (trajectory.sample(t)[1][0] for t in (2.0 - 1e-9, 2.0))
    assert before == pytest.approx(after, abs=1e-6)
    assert after > 0.1


def test_quintic_begins_and_ends_without_a_jerk():
    trajectory = plan_for([(2.0, [0.5, 0.1])], interpolation="quintic").trajectory
    for time_s in (0.0, 2.0 - 1e-12):
        assert trajectory.sample(time_s)[1:] == pytest.approx(np.zeros((2, 2)), abs=1e-6)


def test_linear_way_of_the_notes_leaves_velocities_aside_and_has_corners():
    trajectory = plan_for([(0.0, ARM, ARM), (1.0, moved(1, 0.5), ARM), (2.0, ARM, ARM)], (), **AS_IN_NOTES).trajectory
    velocity = [trajectory.sample(t)[1][1] for t in (0.0, 0.999, 1.001)]
    assert velocity == pytest.approx([0.5, 0.5, -0.5])


@pytest.mark.parametrize("points, settings", [
    ([(0.0, [0.0, 0.0]), (0.0, [1.0, 0.2])], {}),
    ([(0.0, [1.0, 0.2])], {}),
    ([(0.0, [0.0, 0.0]), (60.0, [1.0, 0.2])], {"interpolation": "time_optimal"})])
def test_positions_alone_are_passed_as_fast_as_the_limits_allow(points, settings):
    plan = plan_for(points, **settings)
    # s0: the velocity of the settings, which is below the robot's.
    assert plan.duration_s == pytest.approx(1.0 / 0.5 + 0.5 / 2.0)
    assert plan.trajectory.sample(plan.duration_s)[0] == pytest.approx([1.0, 0.2])


def test_times_that_are_given_are_kept():
    assert plan_for([(0.0, [0.0, 0.0]), (8.3, [1.0, 0.2])]).duration_s == 8.3


def test_goals_without_times_but_with_velocities_are_refused():
    assert reason([(0.0, [0.0, 0.0], [0.0, 0.0]), (0.0, [1.0, 0.2], [0.0, 0.0])]) == "time"
    assert reason([(0.0, [0.0, 0.0]), (0.0, [1.0, 0.2])], interpolation="linear") == "time"


# -- limits -----------------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("points", [[(9.0, moved(3, 2.5))], [(0.1, moved(3, 1.0))]])
def test_limits_are_checked_or_not(points):
    assert reason(points, RIGHT_ARM) in ("limit", "velocity")
    plan = plan_for(points, RIGHT_ARM, check_limits=False)
    assert plan.trajectory.sample(points[0][0])[0] == pytest.approx(points[0][1])
    # Values that are not finite are still refused.
    assert reason([(1.0, moved(3, float("nan")))], RIGHT_ARM, check_limits=False) == "number"


# -- start ------------------------------------------------------------------------------------------------------------

FAR = [(0.0, [0.4, -0.2]), (2.0, [0.6, -0.2])]


def test_first_point_elsewhere_is_refused():
    assert reason(FAR) == "start"


def test_first_point_elsewhere_is_blended_in_when_asked():
    plan = plan_for(FAR, start="blend")
    way = plan.trajectory
    assert way.sample(0.0)[0] == pytest.approx([0.0, 0.0])
    lead_s = plan.duration_s - 2.0
    # At half the velocity of s0, 0.25 rad/s, as for arrival times.
    assert lead_s == pytest.approx(0.4 / 0.25 + 0.25 / 2.0)
    assert way.sample(lead_s)[0] == pytest.approx([0.4, -0.2])
    assert way.sample(plan.duration_s)[0] == pytest.approx([0.6, -0.2])
    grid = np.array([way.sample(t) for t in np.arange(0.0, plan.duration_s, 1e-3)])
    assert np.abs(np.diff(grid[:, 0], axis=0)).max() < 1e-3 * 1.5
    assert np.abs(grid[:, 1]).max() < 0.3


def test_first_point_elsewhere_is_jumped_to_as_in_the_notes():
    points = [(0.0, moved(0, 0.4)), (2.0, moved(0, 0.6))]
    assert plan_for(points, RIGHT_ARM, **AS_IN_NOTES).trajectory.sample(0.0)[0][0] == 0.4
    later = plan_for([(1.0, moved(0, 0.4)), (2.0, moved(0, 0.6))], RIGHT_ARM, **AS_IN_NOTES).trajectory
    assert later.sample(0.5)[0][0] == 0.4 and later.sample(1.5)[0][0] == pytest.approx(0.5)


# -- joints -----------------------------------------------------------------------------------------------------------

def test_any_joints_in_any_order_or_the_right_arm_only():
    mixed = ("left_w2", "right_e1", "left_s0")
    assert plan_for([(1.0, [0.1, 0.2, 0.3])], mixed).joint_names == mixed
    assert plan_for([(1.0, [0.1] * 14)], tuple(reversed(KNOWN_JOINTS))).joint_names == tuple(reversed(KNOWN_JOINTS))
    assert reason([(1.0, [0.1, 0.2, 0.3])], mixed, joints="right_arm") == "size"
    # Names are ignored, as in the notes.
    assert plan_for([(1.0, [0.1] * 7)], tuple(reversed(RIGHT_ARM)), joints="right_arm").joint_names == RIGHT_ARM
