# SPDX-License-Identifier: BSD-3-Clause
"""One trajectory replaces another one, for all joints and for a part of them, by topic and by action.

The conditions and results are those of the test cases of ros_controllers, and so is the shape of the trajectories:
three points for both joints over 4 s; one joint alone over 4 s.
"""
import math
import sys
from pathlib import Path

import numpy as np
import pytest
from actionlib_msgs.msg import GoalStatus
from control_msgs.msg import FollowJointTrajectoryResult

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from trajectory_arm import DT, NS, Arm, trajectory  # noqa: E402

QUARTER = math.pi / 4.0
BOTH = [(1.0, [QUARTER, 0.0]), (2.0, [0.0, -QUARTER]), (4.0, [-QUARTER, QUARTER])]
ALONE = [(1.0, [QUARTER]), (2.0, [2.0 * QUARTER]), (4.0, [-2.0 * QUARTER])]
OTHER = [(1.0, [-QUARTER, QUARTER]), (2.0, [0.5, 0.5])]
SUCCEEDED = FollowJointTrajectoryResult.SUCCESSFUL
BY = ["topic", "action"]


def at_rest(points):
    """The points with velocity and acceleration 0."""
    return [(time, positions, [0.0] * len(positions), [0.0] * len(positions)) for time, positions in points]


def both(stamp_s=0.0):
    return trajectory(*at_rest(BOTH), stamp_s=stamp_s)


def other(stamp_s=0.0):
    return trajectory(*at_rest(OTHER), stamp_s=stamp_s)


def alone(stamp_s=0.0):
    return trajectory(*at_rest(ALONE), names=["elbow"], stamp_s=stamp_s)


def send(arm, by, message):
    if by == "topic":
        arm.topic("command").put(message)
    else:
        arm.goal(message)


def has_arrived(arm, positions, within=1e-9):
    """Desired and actual state are at rest at the positions."""
    state = arm.sent("state")[-1]
    np.testing.assert_allclose(state.desired.positions, positions, atol=within)
    for values in (state.desired.velocities, state.desired.accelerations, state.actual.velocities,
                   state.error.positions, state.error.velocities):
        np.testing.assert_allclose(values, [0.0, 0.0], atol=1e-9)


def ends_of(arm):
    return {goal: (status, code) for goal, status, code in arm.results}


PREEMPTED, DONE = (GoalStatus.PREEMPTED, SUCCEEDED), (GoalStatus.SUCCEEDED, SUCCEEDED)

# -- all joints -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("second", BY)
@pytest.mark.parametrize("first", BY)
def test_a_trajectory_replaces_another_one(first, second):
    arm = Arm()
    send(arm, first, both())
    arm.tick(1.0)
    np.testing.assert_allclose(arm.sent("state")[-1].desired.positions, BOTH[0][1], atol=0.02)
    send(arm, second, other())
    arm.tick(2.5)
    has_arrived(arm, OTHER[-1][1])
    expected = [PREEMPTED] * (first == "action") + [DONE] * (second == "action")
    assert [end[1:] for end in arm.results] == expected


@pytest.mark.parametrize("first", BY)
@pytest.mark.parametrize("stop_s", [0.0, 0.4])
def test_an_empty_command_stops_within_the_stop_duration(first, stop_s):
    arm = Arm(stop_trajectory_duration=stop_s)
    send(arm, first, both())
    arm.tick(1.5)
    here, velocity = arm.hardware.position.copy(), arm.hardware.velocity.copy()
    assert np.abs(velocity).min() > 0.5
    arm.topic("command").put(trajectory())
    arm.tick(stop_s + 0.1)
    # With a duration it runs on from the desired state: a quintic's first half, 5/8 of velocity times duration.
    # The stop begins two ticks later.
    has_arrived(arm, here + velocity * 0.625 * stop_s, within=2.5 * DT * np.abs(velocity).max())
    assert [end[1:] for end in arm.results] == [PREEMPTED] * (first == "action")
    arm.tick(3.0)
    np.testing.assert_allclose(arm.sent("state")[-1].desired.positions, arm.hardware.position, atol=1e-9)


def test_a_command_in_the_past_replaces_nothing():
    arm = Arm()
    arm.goal(both())
    arm.tick(1.0)
    arm.topic("command").put(other(arm.time - 2.5))
    arm.tick(3.5)
    has_arrived(arm, BOTH[-1][1])
    assert ends_of(arm) == {"goal 1": DONE}


# -- a part of the joints ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("by", BY)
def test_one_joint_alone(by):
    arm = Arm(allow_partial_joints_goal=True)
    send(arm, by, alone())
    arm.tick(4.5)
    has_arrived(arm, [0.0, ALONE[-1][1][0]])
    assert [end[1:] for end in arm.results] == [DONE] * (by == "action")
    query = arm.ros.services[NS + "/query_state"]
    found = query(type("Request", (), {"time": arm.sent("state")[-1].header.stamp}))
    np.testing.assert_allclose(found.position, arm.hardware.position, atol=1e-9)
    np.testing.assert_allclose([found.velocity, found.acceleration], np.zeros((2, 2)), atol=1e-9)


def test_a_part_is_active_once_it_is_accepted():
    arm = Arm(allow_partial_joints_goal=True)
    arm.goal(alone())
    arm.tick()
    assert arm.results == []
    assert arm.sent("follow_joint_trajectory/status")[-1].status_list[-1].status == GoalStatus.ACTIVE


@pytest.mark.parametrize("second", BY)
@pytest.mark.parametrize("first", BY)
def test_a_part_replaces_its_joint_and_the_other_goes_on(first, second):
    arm = Arm(allow_partial_joints_goal=True)
    send(arm, first, both())
    arm.tick(1.0)
    send(arm, second, alone())
    arm.tick(1.0)
    # The second point of the first trajectory, and the first one of the second.
    np.testing.assert_allclose(arm.hardware.position, [0.0, QUARTER], atol=0.02)
    arm.tick(3.5)
    has_arrived(arm, [BOTH[-1][1][0], ALONE[-1][1][0]])
    expected = [PREEMPTED] * (first == "action") + [DONE] * (second == "action")
    assert [end[1:] for end in arm.results] == expected


@pytest.mark.parametrize("by", BY)
def test_a_part_in_the_past_replaces_nothing(by):
    arm = Arm(allow_partial_joints_goal=True)
    send(arm, by, both())
    arm.tick(1.0)
    send(arm, by, alone(arm.time - 4.5))
    arm.tick(3.5)
    has_arrived(arm, BOTH[-1][1])
    if by == "action":
        assert ends_of(arm)["goal 1"] == DONE
        assert ends_of(arm)["goal 2"] == (GoalStatus.REJECTED, FollowJointTrajectoryResult.INVALID_GOAL)


def test_of_a_part_that_is_late_the_last_point_is_left():
    arm = Arm(allow_partial_joints_goal=True)
    arm.goal(both())
    arm.tick(1.0)
    arm.goal(alone(arm.time - 3.0))
    arm.tick(0.9)
    # The last point, due 1 s after the command.
    assert arm.hardware.position[1] == pytest.approx(ALONE[-1][1][0], abs=0.05)
    arm.tick(2.6)
    has_arrived(arm, [BOTH[-1][1][0], ALONE[-1][1][0]])
    assert ends_of(arm) == {"goal 1": PREEMPTED, "goal 2": DONE}


def test_until_a_part_begins_both_joints_go_on():
    arm = Arm(allow_partial_joints_goal=True)
    arm.goal(both())
    arm.tick(1.0)
    arm.goal(alone(arm.time + 6.0))
    arm.tick(4.0)
    has_arrived(arm, BOTH[-1][1])
    assert ends_of(arm) == {"goal 1": PREEMPTED}
    arm.tick(6.5)
    has_arrived(arm, [BOTH[-1][1][0], ALONE[-1][1][0]])
    assert ends_of(arm) == {"goal 1": PREEMPTED, "goal 2": DONE}


@pytest.mark.parametrize(("message", "code"), [
    (trajectory((1.0, [0.0, 0.0]), names=["shoulder", "bad_name"]), FollowJointTrajectoryResult.INVALID_JOINTS),
    (trajectory((1.0, [])), FollowJointTrajectoryResult.INVALID_GOAL),
    (trajectory((1.0, [0.0])), FollowJointTrajectoryResult.INVALID_GOAL),
    (trajectory((1.0, [0.0, 0.0]), (1.0, [0.0, 0.0])), FollowJointTrajectoryResult.INVALID_GOAL),
    (trajectory(names=[]), FollowJointTrajectoryResult.INVALID_JOINTS),
])
def test_wrong_goals_are_rejected_where_parts_are_allowed(message, code):
    arm = Arm(allow_partial_joints_goal=True)
    arm.goal(message)
    arm.tick()
    assert arm.results == [("goal 1", GoalStatus.REJECTED, code)]
