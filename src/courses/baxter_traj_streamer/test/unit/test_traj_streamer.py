# SPDX-License-Identifier: BSD-3-Clause
"""Checks of goals, timing and stopping, without a robot."""
import math
import pathlib
import random
import subprocess
import sys

import numpy as np
import pytest

from baxter_traj_streamer.errors import GoalRefused
from baxter_traj_streamer.judging import KNOWN_JOINTS, StreamedJointLimit, judge
from baxter_traj_streamer.motion import StreamedMotion
from baxter_traj_streamer.settings import JOINTS, SIDES, StreamerSettingsError, arm_joint_names
from baxter_traj_streamer.timing import arrival_times, transition_time

sys.path.insert(0, str(pathlib.Path(__file__).parents[1]))
from spoilt_goals import WORDS, spoilt_goal  # noqa: E402
from streamer_settings import make_settings  # noqa: E402

SETTINGS = make_settings()
LIMITS = {name: StreamedJointLimit(-2.0, 2.0, 1.5) for name in KNOWN_JOINTS}
AT_ZERO = dict.fromkeys(KNOWN_JOINTS, 0.0)
RIGHT = arm_joint_names("right")


def point(time_s, *positions, velocities=(), accelerations=()):
    return time_s, list(positions), list(velocities), list(accelerations)


def plan_for(points, names=("right_s0", "left_w2"), measured=AT_ZERO, **settings):
    return judge(names, points, LIMITS, measured, make_settings(**settings))


def refusal(*arguments, **options):
    with pytest.raises(GoalRefused) as caught:
        plan_for(*arguments, **options)
    return caught.value


def test_core_loads_without_ros():
    ros = ("rospy", "actionlib", "sensor_msgs", "trajectory_msgs", "baxter_core_msgs", "std_msgs", "actionlib_msgs")
    code = ("import sys; sys.modules.update(dict.fromkeys(%r)); "
            "from baxter_traj_streamer import curve, judging, motion, optimal, playfile, straight_line" % (ros,))
    subprocess.run([sys.executable, "-c", code], check=True)


def test_action_is_the_one_with_traj_id():
    from baxter_traj_streamer.msg import trajAction, trajActionFeedback, trajActionGoal, trajActionResult
    sums = [message._md5sum for message in (trajAction, trajActionGoal, trajActionResult, trajActionFeedback)]
    assert sums == ["b0d15a5cdd55880dcc8a737c848768dc", "39105c9ddfcdfce0b589fb95b4dc0284",
                    "4d6c3be4f6f04d8a1647f168a75b1ed5", "5a6929cb3514eabf286ff2717ef7a5a4"]


# -- settings and timing ----------------------------------------------------------------------------------------------

def test_left_pre_pose_mirrors_the_right_one():
    assert SETTINGS.pose("pre_pose", "right") == [-0.907528, -0.111813, 2.06622, 1.8737, -1.295, 2.00164, -2.87179]
    assert SETTINGS.pose("pre_pose", "left") == [0.907528, -0.111813, -2.06622, 1.8737, 1.295, 2.00164, 2.87179]


@pytest.mark.parametrize("overrides", [
    {"speed_scale_factor": 0.0}, {"speed_scale_factor": 1.5}, {"rate": 100.0}, {"interpolation": "smooth"},
    {"start": "hop"}, {"joints": "left_arm"}, {"feedback": 1}, {"max_acceleration": {"s0": 1.0}},
    {"poses": {"half": {"left": {"s0": 1.0}}}},
    {"max_velocity": {"s0": 1.0}}, {"max_velocity": dict.fromkeys(JOINTS, math.nan)}, {"rate_hz": "fast"}])
def test_unusable_settings_are_refused(overrides):
    with pytest.raises(StreamerSettingsError):
        make_settings(**overrides)


def test_a_parameter_that_is_no_table_is_refused(monkeypatch):
    from baxter_traj_streamer import ros_settings

    monkeypatch.setattr(ros_settings.rospy, "get_param", lambda *_: 3)
    with pytest.raises(StreamerSettingsError, match="parameter /baxter_traj_streamer is 3"):
        ros_settings.read_settings()


def test_poses_of_the_robot_are_known_too():
    for side in SIDES:
        assert SETTINGS.pose("neutral", side) == [0.0, -0.55, 0.0, 0.75, 0.0, 1.26, 0.0]
    assert SETTINGS.pose("untucked", "right")[:2] == [0.08, -1.0]


def test_unknown_pose_and_side_are_refused():
    with pytest.raises(StreamerSettingsError, match="pre_pose"):
        SETTINGS.pose("post_pose", "right")
    with pytest.raises(StreamerSettingsError, match="right and left"):
        SETTINGS.pose("pre_pose", "up")


def test_slowest_joint_decides_the_time():
    velocity = SETTINGS.planning_velocity()
    assert velocity == [0.25, 0.25, 0.25, 0.25, 0.5, 0.5, 0.5]
    assert transition_time([0.0, 0.5, 0.0, 0.0, 0.9, 0.0, 0.0], velocity) == pytest.approx(2.0)
    assert transition_time([0.0, 0.5, 0.0, 0.0, -1.1, 0.0, 0.0], velocity) == pytest.approx(2.2)
    with pytest.raises(ValueError, match="expected 7"):
        transition_time([0.0], velocity)
    with pytest.raises(ValueError, match="finite"):
        transition_time([math.nan] * 7, velocity)


def test_pre_pose_from_zero_takes_as_long_as_in_the_notes():
    path = [[0.0] * 7, SETTINGS.pose("pre_pose", "right")]
    assert arrival_times(path, SETTINGS.planning_velocity(), 0.02) == pytest.approx([0.0, 2.06622 / 0.25])


def test_equal_poses_still_take_a_segment():
    assert arrival_times([[0.0] * 7] * 3, SETTINGS.planning_velocity(), 0.02) == pytest.approx([0.0, 0.02, 0.04])


# -- judging ----------------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("side", SIDES)
def test_names_may_be_any_subset_in_any_order(side):
    names = ("%s_w1" % side, "%s_s0" % side)
    plan = plan_for([point(0.0, 0.0, 0.0), point(1.0, 0.2, -0.3)], names)
    assert plan.joint_names == names
    assert plan.trajectory.sample(1.0)[0] == pytest.approx([0.2, -0.3])


def test_both_arms_in_one_goal():
    plan = plan_for([point(2.0, *[0.1] * 14)], KNOWN_JOINTS)
    assert plan.trajectory.sample(2.0)[0] == pytest.approx([0.1] * 14)


def test_without_names_the_right_arm_is_meant():
    assert plan_for([point(2.0, *[0.1] * 7)], ()).joint_names == tuple(RIGHT)


REFUSED = {
    "no points": ([], {}, ("empty", None, None)),
    "NaN position": ([point(1.0, 0.0, math.nan)], {}, ("number", 0, "left_w2")),
    "infinite velocity": ([point(1.0, 0.0, 0.0, velocities=[math.inf, 0.0])], {}, ("number", 0, "right_s0")),
    "NaN time": ([point(math.nan, 0.0, 0.0)], {}, ("number", 0, None)),
    "short point": ([point(1.0, 0.0, 0.0), point(2.0, 0.0)], {}, ("size", 1, None)),
    "no positions": ([point(1.0)], {}, ("size", 0, None)),
    "short velocities": ([point(1.0, 0.0, 0.0, velocities=[0.0])], {}, ("size", 0, None)),
    "same time": ([point(1.0, 0.0, 0.0), point(1.0, 0.0, 0.1)], {}, ("time", 1, None)),
    "negative time": ([point(-1.0, 0.0, 0.0), point(1.0, 0.0, 0.1)], {}, ("time", 0, None)),
    "at once only": ([point(0.0, 0.0, 0.0)], {"interpolation": "linear"}, ("time", 0, None)),
    "at once with velocities": ([point(0.0, 0.0, 0.0, velocities=[0.0, 0.0])], {}, ("time", 0, None)),
    "too long at best": ([point(0.0, 1.9, 0.0), point(0.0, -1.9, 0.0)], {"max_duration_s": 5.0},
                         ("too_long", None, None)),
    "too long": ([point(1.0, 0.0, 0.0), point(601.0, 0.0, 0.1)], {}, ("too_long", 1, None)),
    "too many": ([point(1.0 + i, 0.0, 0.0) for i in range(4)], {"max_points": 3}, ("too_long", None, None)),
    "above limit": ([point(9.0, 0.0, 2.1)], {}, ("limit", 0, "left_w2")),
    "below limit": ([point(9.0, 0.0, 0.0), point(19.0, -2.1, 0.0)], {}, ("limit", 1, "right_s0")),
    "over the edge": ([point(2.0, 0.0, 1.9, velocities=[0.0, 1.4]), point(3.0, 0.0, 1.9, velocities=[0.0, 0.0])], {},
                      ("limit", 1, "left_w2")),
    "too fast": ([point(1.0, 0.0, 0.0), point(2.0, 1.2, 0.0)], {}, ("velocity", 1, "right_s0")),
    "too fast to point 0": ([point(0.01, 0.5, 0.0)], {}, ("velocity", 0, "right_s0")),
    "jump at start": ([point(0.0, 0.0, 0.2), point(9.0, 0.0, 0.0)], {}, ("start", 0, "left_w2")),
    "unknown joint": ([point(1.0, 0.0, 0.0)], {"names": ("right_s0", "head_pan")}, ("joints", None, "head_pan")),
    "repeated joint": ([point(1.0, 0.0, 0.0)], {"names": ("left_s0", "left_s0")}, ("joints", None, "left_s0")),
    "unreported joint": ([point(1.0, 0.0, 0.0)], {"measured": {"right_s0": 0.0}}, ("joints", None, "left_w2")),
}


@pytest.mark.parametrize("points, options, expected", REFUSED.values(), ids=REFUSED)
def test_bad_goals_are_refused_by_reason(points, options, expected):
    found = refusal(points, **options)
    assert (found.reason, found.point, found.joint) == expected
    if found.point is not None and found.reason != "number":
        assert found.limit is not None or found.reason == "start"


def test_verdict_names_point_joint_value_and_limit():
    found = refusal([point(9.0, 0.0, 0.0), point(29.0, 0.0, 2.5)])
    assert (found.value, found.limit) == (2.5, pytest.approx(2.001))
    for word in ("point 1", "left_w2", "2.500000", "2.001"):
        assert word in str(found)


def test_five_hundred_random_spoilt_goals_are_refused_each_for_its_reason():
    source = random.Random(5)
    for number in range(500):
        kind, names, rows, good = spoilt_goal(source, number, LIMITS, AT_ZERO)
        if kind != "joints":
            plan_for([point(time_s, *positions) for time_s, positions in good], names)
        found = refusal([point(time_s, *positions) for time_s, positions in rows], names)
        assert found.reason == kind
        assert WORDS[kind] in str(found)


def test_a_joint_beyond_its_limit_may_come_back_but_go_no_farther():
    outside = dict(AT_ZERO, left_w2=2.03)
    plan_for([point(2.0, 0.0, 1.9)], measured=outside)
    assert refusal([point(2.0, 0.0, 2.05)], measured=outside).reason == "limit"


def test_while_the_robot_moves_all_but_the_start_is_judged():
    plan_for([point(0.0, 1.0, 1.0), point(2.0, 1.1, 1.1)], measured=None)
    assert refusal([point(0.0, 1.0, 2.1), point(2.0, 1.0, 1.1)], measured=None).reason == "limit"


# -- the path ----------------------------------------------------------------------------------------------------------

def test_smooth_way_starts_and_ends_at_rest_and_hits_the_points():
    positions = ([0.0, 0.0], [0.3, 0.2], [0.5, -0.1])
    trajectory = plan_for([point(float(i), *p) for i, p in enumerate(positions)]).trajectory
    for i, expected in enumerate(positions):
        assert trajectory.sample(float(i))[0] == pytest.approx(expected)
    assert trajectory.sample(0.0)[1] == pytest.approx([0.0, 0.0])
    assert trajectory.sample(2.0 - 1e-9)[1] == pytest.approx([0.0, 0.0], abs=1e-6)
    # w2 reverses at point 1.
    assert max(trajectory.sample(t)[0][1] for t in np.linspace(0.0, 2.0, 200)) <= 0.2 + 1e-9


def test_linear_way_has_constant_velocity():
    trajectory = plan_for([point(0.0, 0.0, 0.0), point(2.0, 1.0, 0.0)], interpolation="linear").trajectory
    assert [trajectory.sample(t)[1][0] for t in (0.0, 1.0, 1.99)] == pytest.approx([0.5] * 3)


def test_velocities_of_points_are_used():
    trajectory = plan_for([point(0.0, 0.0, 0.0, velocities=[0.0, 0.0]), point(1.0, 0.3, 0.0, velocities=[0.4, 0.0]),
                           point(2.0, 0.5, 0.0, velocities=[0.0, 0.0])]).trajectory
    assert trajectory.sample(1.0)[1] == pytest.approx([0.4, 0.0])


def test_the_way_begins_where_the_robot_is():
    trajectory = plan_for([point(0.0, 0.05, 0.0), point(2.0, 1.0, 0.0)]).trajectory
    assert trajectory.sample(0.0)[0] == pytest.approx([0.0, 0.0])


@pytest.mark.parametrize("interpolation", ["fields", "linear", "quintic", "time_optimal"])
def test_stop_keeps_to_the_way_and_decelerates_within_the_bound(interpolation):
    plan = plan_for([point(0.0, 0.0, 0.0), point(2.0, 1.5, -0.5)], interpolation=interpolation)
    motion = StreamedMotion(plan, 10.0, SETTINGS.stop_deceleration)
    before = motion.positions(11.0)
    motion.stop(11.0)
    assert not motion.is_at_rest(11.0)
    times = np.arange(11.0, 13.0, 0.001)
    way = np.array([motion.positions(t) for t in times])
    assert way[0] == pytest.approx(before)
    velocity = np.diff(way, axis=0) / 0.001
    own = max(np.abs(plan.trajectory.sample(t)[2]).max() for t in np.linspace(0.0, 2.0, 500))
    assert np.abs(np.diff(velocity, axis=0) / 0.001).max() <= SETTINGS.stop_deceleration + own + 1e-3
    assert np.abs(velocity[-1]).max() == 0.0
    assert motion.is_at_rest(13.0) and motion.percent(13.0) < 100
    # Still on the way: the joints keep their ratio.
    assert way[:, 1] == pytest.approx(way[:, 0] / -3.0)


def test_motion_that_is_let_go_reaches_its_end():
    motion = StreamedMotion(plan_for([point(2.0, 1.0, 0.5)]), 10.0, 2.0)
    assert motion.positions(10.0) == pytest.approx([0.0, 0.0])
    assert not motion.is_at_rest(11.9) and motion.is_at_rest(12.0)
    assert motion.positions(12.0) == pytest.approx([1.0, 0.5]) and motion.percent(12.0) == 100
