# SPDX-License-Identifier: BSD-3-Clause
"""The trajectory controllers on joints without physics, without a master: messages in, commands and messages out."""
import math
import sys
from pathlib import Path

import genpy
import numpy as np
import pytest
import rospy
from actionlib_msgs.msg import GoalID, GoalStatus
from control_msgs.msg import FollowJointTrajectoryResult

from controller_manager import EFFORT, POS_VEL, POS_VEL_ACC, POSITION, VELOCITY, ControllerError
from joint_trajectory import ErrorCode
from ros_controllers.joint_trajectory_controller import (
    EffortJointTrajectoryController,
    PosVelAccJointTrajectoryController,
    PosVelJointTrajectoryController,
    VelocityJointTrajectoryController,
)

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from trajectory_arm import JOINTS, NS, Arm, trajectory  # noqa: E402

GAINS = {joint: {"p": 40.0, "d": 0.0} for joint in JOINTS}

R = FollowJointTrajectoryResult

# -- loading ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("changes, text", [
    ({"joints": None}, "parameter /robot/arm/joints is missing"),
    ({"joints": []}, "parameter /robot/arm/joints"),
    ({"joints": ["shoulder", "wrist"]}, "joint 'wrist' cannot be used|no joint wrist"),
    ({"constraints": {"goal_time": -1.0}}, "constraints/goal_time is -1, expected 0 or more"),
    ({"constraints": {"elbow": {"goal": "near"}}}, "constraints/elbow/goal is 'near', expected a number"),
    ({"stop_trajectory_duration": -0.5}, "stop_trajectory_duration is -0.5"),
    ({"allow_partial_joints_goal": "yes"}, "allow_partial_joints_goal is 'yes', expected true or false"),
])
def test_wrong_parameters_are_refused(changes, text):
    with pytest.raises(ControllerError, match=text):
        Arm(**changes)


@pytest.mark.parametrize("controller_class", [VelocityJointTrajectoryController, EffortJointTrajectoryController])
def test_missing_gains_are_refused(controller_class):
    with pytest.raises(ControllerError, match="gains/elbow/p is missing"):
        Arm(controller_class, gains={"shoulder": {"p": 1.0}})


def test_claims_its_joints():
    assert Arm().controller.claims == {POSITION: JOINTS}


# -- following --------------------------------------------------------------------------------------------------------

def test_stiff_joints_are_where_they_should_be_at_every_tick():
    """A quintic through five points at up to 1 rad/s, less than 0.002 rad off at every tick."""
    arm = Arm()
    rng = np.random.default_rng(5)
    points = [(1.0 * (i + 1), *rng.uniform(-0.4, 0.4, size=(3, 2)).tolist()) for i in range(5)]
    points[-1] = (5.0, points[-1][1], [0.0, 0.0], [0.0, 0.0])
    arm.goal(trajectory(*points))
    fastest = worst = 0.0
    moved = 0
    while not arm.results and arm.time < 110.0:
        before = arm.hardware.command[POSITION].copy()
        arm.tick()
        moved += not np.array_equal(before, arm.hardware.command[POSITION])
        follower = arm.controller._follower
        fastest = max(fastest, np.abs(follower.desired[1]).max())
        worst = max(worst, np.abs(follower.desired[0] - arm.hardware.position).max())
    assert arm.results == [("goal 1", GoalStatus.SUCCEEDED, R.SUCCESSFUL)]
    assert arm.result_text == ""
    assert fastest > 0.7 and moved > 2490
    assert worst < 1e-9


@pytest.mark.parametrize("controller_class, interface", [
    (PosVelJointTrajectoryController, POS_VEL), (PosVelAccJointTrajectoryController, POS_VEL_ACC)])
def test_positions_with_velocities_are_followed_as_positions_are(controller_class, interface):
    arm = Arm(controller_class)
    assert arm.controller.claims == {interface: JOINTS}
    arm.goal(trajectory((1.0, [0.3, -0.2], [0.0, 0.0])))
    worst = 0.0
    while not arm.results and arm.time < 105.0:
        arm.tick()
        desired = arm.controller._follower.desired
        worst = max(worst, np.abs(desired[0] - arm.hardware.position).max())
    assert arm.results == [("goal 1", GoalStatus.SUCCEEDED, R.SUCCESSFUL)] and worst < 1e-9
    assert arm.hardware.position == pytest.approx([0.3, -0.2])


def test_starts_where_the_joints_are():
    arm = Arm(start=False)
    arm.hardware.position[:] = 0.5, -0.25
    arm.controller.starting(1.0)
    np.testing.assert_array_equal(arm.hardware.command[POSITION], [0.5, -0.25])
    arm.tick()
    np.testing.assert_array_equal(arm.hardware.command[POSITION], [0.5, -0.25])


def test_joints_come_in_any_order():
    arm = Arm()
    arm.goal(trajectory((0.1, [2.0, 1.0]), names=["elbow", "shoulder"]))
    arm.tick(0.2)
    np.testing.assert_allclose(arm.hardware.position, [1.0, 2.0])


def test_continuous_joint_takes_the_shorter_way_and_the_other_does_not():
    arm = Arm()
    arm.hardware.position[:] = 3.0, 3.0
    arm.controller.starting(arm.time)
    arm.goal(trajectory((0.1, [-3.0, -3.0])))
    arm.tick(0.2)
    np.testing.assert_allclose(arm.hardware.position, [2 * math.pi - 3.0, -3.0])


@pytest.mark.parametrize("controller_class, parameters, within", [
    (VelocityJointTrajectoryController, {"gains": GAINS, "velocity_ff": {"elbow": 1.0, "shoulder": 1.0}}, 0.005),
    (VelocityJointTrajectoryController, {"gains": GAINS}, 0.05),
    (EffortJointTrajectoryController, {"gains": {joint: {"p": 4000.0, "d": 120.0} for joint in JOINTS}}, 0.02),
])
def test_velocity_and_effort_joints_follow(controller_class, parameters, within):
    arm = Arm(controller_class, **parameters)
    arm.goal(trajectory((1.0, [0.5, -0.5], [0.0, 0.0], [0.0, 0.0])), goal_time_s=1.0,
             at_goal=[(joint, 0.01, 1.0, 0.0) for joint in JOINTS])
    worst = 0.0
    for _ in range(400):
        arm.tick()
        worst = max(worst, np.abs(arm.controller._follower.error[0]).max())
    assert worst < within
    arm.tick(1.0)
    assert arm.results == [("goal 1", GoalStatus.SUCCEEDED, R.SUCCESSFUL)]
    np.testing.assert_allclose(arm.hardware.position, [0.5, -0.5], atol=0.01)


def test_velocity_feed_forward_is_the_desired_velocity():
    arm = Arm(VelocityJointTrajectoryController, gains={joint: {"p": 0.0} for joint in JOINTS},
              velocity_ff={"elbow": 0.5})
    arm.goal(trajectory((1.0, [1.0, 1.0])))
    arm.tick(0.1)
    np.testing.assert_allclose(arm.hardware.command[VELOCITY], [0.0, 0.5])


def test_effort_is_the_pid_of_the_error():
    arm = Arm(EffortJointTrajectoryController, gains={joint: {"p": 100.0, "d": 10.0} for joint in JOINTS})
    arm.hardware.frozen = True
    arm.goal(trajectory((1.0, [1.0, 0.0])))
    arm.tick()
    arm.tick(0.1)
    np.testing.assert_allclose(arm.hardware.command[EFFORT], [100.0 * 0.1 + 10.0 * 1.0, 0.0], atol=0.25)


# -- what is accepted -------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("message, code, text", [
    (trajectory((1.0, [0.0]), names=["elbow"]), R.INVALID_JOINTS, "lacks shoulder"),
    (trajectory((1.0, [0.0, 0.0]), names=["elbow", "x"]), R.INVALID_JOINTS, "unknown joint x"),
    (trajectory((1.0, []), names=[]), R.INVALID_JOINTS, "joint_names is empty"),
    (trajectory(names=[]), R.INVALID_JOINTS, "joint_names is empty"),
    (trajectory((1.0, [0.0, 0.0]), (1.0, [0.0, 0.0])), R.INVALID_GOAL, "time_from_start must increase"),
    (trajectory((1.0, [0.0])), R.INVALID_GOAL, "point 0 has 1 position, expected 2"),
    (trajectory((1.0, [0.0, 0.0], [0.0])), R.INVALID_GOAL, "point 0 has 1 velocity"),
    (trajectory((1.0, [])), R.INVALID_GOAL, "has no positions"),
    (trajectory((1.0, [0.0, math.nan])), R.INVALID_GOAL, "not finite"),
    (trajectory((1.0, [0.0, 0.0]), stamp_s=90.0), R.INVALID_GOAL, "all points (1) are in the past"),
    (trajectory((0.0, [0.0, 0.0])), R.INVALID_GOAL, "time_from_start above 0"),
])
def test_goals_that_cannot_be_followed_are_rejected_and_change_nothing(message, code, text):
    arm = Arm()
    arm.goal(trajectory((1.0, [1.0, 1.0])))
    arm.tick(0.1)
    arm.goal(message)
    arm.tick()
    assert arm.results == [("goal 2", GoalStatus.REJECTED, code)]
    assert text in arm.result_text
    assert any(text in line for line in arm.log.of("error"))
    arm.tick(1.0)
    assert arm.results[1:] == [("goal 1", GoalStatus.SUCCEEDED, R.SUCCESSFUL)]


@pytest.mark.parametrize("message", [trajectory((1.0, [0.0]), names=["elbow"]), trajectory((1.0, [0.0]))])
def test_wrong_topic_commands_are_reported_and_change_nothing(message):
    arm = Arm()
    arm.goal(trajectory((0.1, [1.0, 1.0])))
    arm.tick()
    arm.topic("command").put(message)
    arm.tick(0.2)
    assert len(arm.log.of("error")) == 1 and "/robot/arm/command: trajectory ignored" in arm.log.of("error")[0]
    assert arm.results == [("goal 1", GoalStatus.SUCCEEDED, R.SUCCESSFUL)]


def test_late_points_are_left_out_with_a_warning():
    arm = Arm()
    arm.goal(trajectory((1.0, [9.0, 9.0]), (3.0, [1.0, 1.0]), stamp_s=98.0))
    arm.tick(1.1)
    assert "1 of 2 points" in arm.log.of("warn")[0]
    np.testing.assert_allclose(arm.hardware.position, [1.0, 1.0])
    assert arm.results == [("goal 1", GoalStatus.SUCCEEDED, R.SUCCESSFUL)]


def test_first_point_at_once_is_left_out_silently():
    arm = Arm()
    arm.goal(trajectory((0.0, [9.0, 9.0]), (0.1, [1.0, 1.0])))
    arm.tick(0.2)
    assert arm.log.lines == []
    np.testing.assert_allclose(arm.hardware.position, [1.0, 1.0])


def test_future_start_is_waited_for():
    arm = Arm()
    arm.goal(trajectory((0.1, [1.0, 1.0]), stamp_s=101.0))
    arm.tick(0.9)
    np.testing.assert_array_equal(arm.hardware.position, [0.0, 0.0])
    assert arm.results == []
    arm.tick(0.25)
    np.testing.assert_allclose(arm.hardware.position, [1.0, 1.0])
    assert arm.results == [("goal 1", GoalStatus.SUCCEEDED, R.SUCCESSFUL)]


def test_goal_is_rejected_while_the_controller_does_not_run():
    arm = Arm(start=False)
    arm.goal(trajectory((1.0, [1.0, 1.0])))
    arm.controller.idle(1.0)
    assert arm.results == [("goal 1", GoalStatus.REJECTED, R.INVALID_GOAL)]
    assert "does not run" in arm.result_text


def test_commands_from_before_the_start_do_not_count():
    arm = Arm(start=False)
    arm.topic("command").put(trajectory((0.1, [1.0, 1.0])))
    arm.controller.starting(arm.time)
    arm.tick(0.2)
    np.testing.assert_array_equal(arm.hardware.position, [0.0, 0.0])


def test_part_of_the_joints_where_that_is_allowed():
    arm = Arm(allow_partial_joints_goal=True)
    arm.topic("command").put(trajectory((1.0, [1.0, 1.0])))
    arm.tick(0.5)
    arm.goal(trajectory((0.1, [0.0]), names=["elbow"]))
    arm.tick(0.2)
    np.testing.assert_allclose(arm.hardware.position, [0.7, 0.0], atol=0.005)
    assert arm.results == []
    arm.tick(0.5)
    np.testing.assert_allclose(arm.hardware.position, [1.0, 0.0])
    assert arm.results == [("goal 1", GoalStatus.SUCCEEDED, R.SUCCESSFUL)]


# -- how goals end ----------------------------------------------------------------------------------------------------

def test_path_tolerance():
    arm = Arm(constraints={"elbow": {"trajectory": 0.05}})
    arm.hardware.frozen = True
    arm.goal(trajectory((1.0, [1.0, 1.0])))
    arm.tick(0.1)
    assert arm.results == [("goal 1", GoalStatus.ABORTED, R.PATH_TOLERANCE_VIOLATED)]
    assert arm.result_text.startswith("elbow path error 0.05")
    # The joints go on along the trajectory.
    arm.hardware.frozen = False
    arm.tick(1.0)
    np.testing.assert_allclose(arm.hardware.position, [1.0, 1.0])
    assert len(arm.results) == 1


def test_goal_tolerance_with_and_without_more_time():
    arm = Arm(constraints={"goal_time": 0.2, "shoulder": {"goal": 0.01}})
    arm.hardware.frozen = True
    arm.goal(trajectory((0.1, [1.0, 0.0])))
    arm.tick(0.25)
    assert arm.results == []
    arm.tick(0.1)
    assert arm.results == [("goal 1", GoalStatus.ABORTED, R.GOAL_TOLERANCE_VIOLATED)]
    assert arm.result_text.startswith("shoulder goal error 1.000000")
    arm.goal(trajectory((0.1, [1.0, 0.0])), goal_time_s=-1.0)
    arm.tick(0.12)
    assert arm.results[1:] == [("goal 2", GoalStatus.ABORTED, R.GOAL_TOLERANCE_VIOLATED)]


def test_tolerances_of_a_goal_do_not_stay_for_the_next():
    arm = Arm()
    arm.hardware.frozen = True
    arm.goal(trajectory((0.1, [1.0, 1.0])), path=[("elbow", 0.01, 0.0, 0.0)])
    arm.tick(0.2)
    assert arm.results == [("goal 1", GoalStatus.ABORTED, R.PATH_TOLERANCE_VIOLATED)]
    arm.goal(trajectory((0.1, [1.0, 1.0])))
    arm.tick(0.2)
    assert arm.results[1:] == [("goal 2", GoalStatus.SUCCEEDED, R.SUCCESSFUL)]


def test_new_goal_preempts_the_old():
    arm = Arm()
    arm.goal(trajectory((1.0, [1.0, 1.0])))
    arm.tick(0.1)
    arm.goal(trajectory((0.1, [0.0, 0.0])))
    arm.tick()
    assert arm.results == [("goal 1", GoalStatus.PREEMPTED, R.SUCCESSFUL)]
    arm.tick(0.2)
    assert arm.results[1:] == [("goal 2", GoalStatus.SUCCEEDED, R.SUCCESSFUL)]


def test_topic_command_preempts_the_goal():
    arm = Arm()
    arm.goal(trajectory((1.0, [1.0, 1.0])))
    arm.tick(0.1)
    arm.topic("command").put(trajectory((0.1, [0.0, 0.0])))
    arm.tick(0.2)
    assert arm.results == [("goal 1", GoalStatus.PREEMPTED, R.SUCCESSFUL)]
    np.testing.assert_allclose(arm.hardware.position, [0.0, 0.0], atol=1e-12)


def test_cancel_stops_the_joints_where_they_are():
    arm = Arm()
    goal_id = arm.goal(trajectory((1.0, [1.0, 1.0])))
    arm.tick(0.5)
    arm.topic("follow_joint_trajectory/cancel").put(GoalID(id=goal_id))
    arm.tick()
    here = arm.hardware.position.copy()
    arm.tick(0.5)
    assert arm.results == [("goal 1", GoalStatus.PREEMPTED, R.SUCCESSFUL)]
    np.testing.assert_allclose(arm.hardware.position, here)
    np.testing.assert_allclose(here, [0.5, 0.5], atol=0.01)


def test_cancel_with_a_stop_duration_runs_out_smoothly():
    arm = Arm(stop_trajectory_duration=0.4)
    goal_id = arm.goal(trajectory((1.0, [1.0, 1.0])))
    arm.tick(0.5)
    arm.topic("follow_joint_trajectory/cancel").put(GoalID(id=goal_id))
    velocities = []
    for _ in range(250):
        arm.tick()
        velocities.append(arm.hardware.velocity[0])
    np.testing.assert_allclose(arm.hardware.position, 0.5 + 0.4 * 5 / 8, atol=0.01)
    assert np.abs(np.diff(velocities)).max() < 0.02


def test_cancel_of_an_old_goal_does_not_matter():
    arm = Arm()
    first = arm.goal(trajectory((1.0, [1.0, 1.0])))
    arm.tick(0.1)
    arm.goal(trajectory((0.1, [1.0, 1.0])))
    arm.tick()
    arm.topic("follow_joint_trajectory/cancel").put(GoalID(id=first))
    arm.tick(0.2)
    assert arm.results[1:] == [("goal 2", GoalStatus.SUCCEEDED, R.SUCCESSFUL)]


@pytest.mark.parametrize("names", [JOINTS, ["elbow"], []])
def test_topic_command_without_points_stops_whatever_the_names(names):
    arm = Arm()
    arm.goal(trajectory((1.0, [1.0, 1.0])))
    arm.tick(0.5)
    arm.topic("command").put(trajectory(names=names))
    arm.tick(0.5)
    np.testing.assert_allclose(arm.hardware.position, [0.5, 0.5], atol=0.01)
    assert arm.results == [("goal 1", GoalStatus.PREEMPTED, R.SUCCESSFUL)]


def test_goal_without_points_stops_and_succeeds():
    arm = Arm()
    arm.goal(trajectory((1.0, [1.0, 1.0])))
    arm.tick(0.5)
    arm.goal(trajectory())
    arm.tick(0.01)
    assert arm.results == [("goal 1", GoalStatus.PREEMPTED, R.SUCCESSFUL),
                           ("goal 2", GoalStatus.SUCCEEDED, R.SUCCESSFUL)]
    np.testing.assert_allclose(arm.hardware.position, [0.5, 0.5], atol=0.01)


def test_stopping_cancels_the_goal():
    arm = Arm()
    arm.goal(trajectory((1.0, [1.0, 1.0])))
    arm.tick(0.5)
    arm.controller.stopping(arm.time)
    assert arm.results == [("goal 1", GoalStatus.PREEMPTED, R.SUCCESSFUL)]
    arm.controller.starting(arm.time)
    arm.tick(0.5)
    np.testing.assert_allclose(arm.hardware.position, [0.5, 0.5], atol=0.01)


# -- publications -----------------------------------------------------------------------------------------------------

def test_state_says_desired_actual_and_error_of_the_same_tick():
    arm = Arm(lag=0.9)
    arm.topic("command").put(trajectory((1.0, [1.0, 0.5])))
    arm.tick(0.5)
    state = arm.sent("state")[-1]
    assert state.joint_names == JOINTS
    np.testing.assert_allclose(np.subtract(state.desired.positions, state.actual.positions), state.error.positions)
    assert state.error.positions[0] > 0.01
    assert [len(point.accelerations) for point in (state.desired, state.actual, state.error)] == [2, 0, 0]
    assert 0.45 < state.desired.time_from_start.to_sec() < 0.5
    assert abs(state.header.stamp.to_sec() - arm.time) < 0.021


@pytest.mark.parametrize("parameters, expected", [({}, 100), ({"state_publish_rate": 10.0}, 20),
                                                  ({"state_publish_rate": 0.0}, 0)])
def test_rate_of_the_state(parameters, expected):
    arm = Arm(**parameters)
    arm.tick(2.0)
    assert len(arm.sent("state")) == expected


def test_feedback_comes_while_a_goal_is_active():
    arm = Arm(action_monitor_rate=20)
    arm.tick(0.5)
    assert arm.sent("follow_joint_trajectory/feedback") == []
    arm.goal(trajectory((1.0, [1.0, 1.0])))
    arm.tick(2.0)
    feedback = arm.sent("follow_joint_trajectory/feedback")
    assert len(feedback) in (20, 21)
    assert feedback[10].feedback.desired.positions[0] == pytest.approx(0.5, abs=0.01)
    assert feedback[10].status.goal_id.id == "goal 1"


def test_query_tells_the_desired_state_at_a_time():
    arm = Arm()
    query = arm.ros.services[NS + "/query_state"]
    arm.topic("command").put(trajectory((1.0, [1.0, 2.0])))
    arm.tick(0.1)

    def ask(time):
        return query(type("Request", (), {"time": genpy.Time.from_sec(time)}))

    response = ask(100.504)
    assert list(response.name) == JOINTS
    np.testing.assert_allclose(response.position, [0.5, 1.0], atol=0.003)
    np.testing.assert_allclose(response.velocity, [1.0, 2.0], atol=0.003)
    with pytest.raises(rospy.ServiceException, match="before the start of the trajectory"):
        ask(50.0)
    arm.controller.stopping(arm.time)
    with pytest.raises(rospy.ServiceException, match="does not run"):
        ask(100.5)


def test_error_codes_are_those_of_the_message():
    assert {code.name: code.value for code in ErrorCode} == {
        code.name: getattr(FollowJointTrajectoryResult, code.name) for code in ErrorCode}
    assert len(ErrorCode) == sum(isinstance(value, int) for name, value in vars(FollowJointTrajectoryResult).items()
                                 if name.isupper())
