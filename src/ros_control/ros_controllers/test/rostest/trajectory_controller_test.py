#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""A trajectory controller as clients see it: Debian's action clients on joints with faults, no physics."""
import sys

import actionlib
import numpy as np
import rospy
import rostest
from actionlib_msgs.msg import GoalID, GoalStatus, GoalStatusArray
from control_msgs.msg import (
    FollowJointTrajectoryAction,
    FollowJointTrajectoryActionGoal,
    FollowJointTrajectoryActionResult,
    FollowJointTrajectoryGoal,
    FollowJointTrajectoryResult,
    JointTolerance,
    JointTrajectoryControllerState,
)
from control_msgs.srv import QueryTrajectoryState
from controller_manager_msgs.srv import LoadController, SwitchController
from std_srvs.srv import SetBool
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from lab_testing import subtests
from lab_testing.waiting import stretched, wait_until

JOINTS = ["shoulder", "elbow"]
ACTION = "/robot/arm/follow_joint_trajectory"
START_S = stretched(60.0)  # for the joints and their controller manager to come
WAIT_S = stretched(90.0)
R = FollowJointTrajectoryResult


def trajectory(*points, names=JOINTS, start=None):
    """Points: (time from start [s], positions)."""
    message = JointTrajectory(joint_names=list(names))
    if start is not None:
        message.header.stamp = start
    message.points = [JointTrajectoryPoint(positions=positions, time_from_start=rospy.Duration.from_sec(when))
                      for when, positions in points]
    return message


def goal(*points, **options):
    return FollowJointTrajectoryGoal(trajectory=trajectory(*points, **options))


def service(name, srv_class, *arguments):
    rospy.wait_for_service(name, WAIT_S)
    return rospy.ServiceProxy(name, srv_class)(*arguments)


def switch(start=(), stop=()):
    assert service("/robot/controller_manager/switch_controller", SwitchController, start, stop, 2, False, 5.0).ok


class TrajectoryControllerTest(subtests.TestCase):
    @classmethod
    def setUpClass(cls):
        for name in ("load_controller", "switch_controller"):
            rospy.wait_for_service("/robot/controller_manager/" + name, START_S)
        assert service("/robot/controller_manager/load_controller", LoadController, "arm").ok
        switch(start=["arm"])
        cls.client = actionlib.SimpleActionClient(ACTION, FollowJointTrajectoryAction)
        assert cls.client.wait_for_server(rospy.Duration(START_S)), "no action server"
        cls.state = None
        cls.state_subscriber = rospy.Subscriber("/robot/arm/state", JointTrajectoryControllerState, cls._on_state)
        cls.command = rospy.Publisher("/robot/arm/command", JointTrajectory, queue_size=1)
        wait_until(lambda: cls.state is not None and cls.command.get_num_connections(), "the controller's topics",
                   START_S)

    @classmethod
    def _on_state(cls, message):
        cls.state = message

    def setUp(self):
        for fault in ("lag", "clip", "freeze"):
            service("/robot/" + fault, SetBool, False)
        self.go(goal((0.05, [0.0, 0.0])))
        # An old state would still show the previous test's motion.
        type(self).state = None
        wait_until(lambda: self.state is not None and not any(self.state.desired.velocities), "rest")

    def go(self, a_goal):
        """Send, wait, and return (state, result)."""
        self.client.send_goal(a_goal)
        self.assertTrue(self.client.wait_for_result(rospy.Duration(WAIT_S)), "no result")
        return self.client.get_state(), self.client.get_result()

    def wait_active(self, client=None):
        wait_until(lambda: (client or self.client).get_state() == GoalStatus.ACTIVE, "the goal to become active")

    def wait_at(self, *positions):
        wait_until(lambda: np.allclose(self.state.actual.positions, positions, atol=1e-3),
                   "joints at %s" % (positions,))

    def assert_stands(self):
        """The joints are at rest, somewhere between (0, 0) and (1, 1)."""
        wait_until(lambda: not any(self.state.desired.velocities) and not any(self.state.actual.velocities), "rest")
        self.assertTrue(all(0.0 <= position < 0.9 for position in self.state.actual.positions), self.state.actual)

    def assert_ended(self, ended, state, code):
        self.assertEqual((ended[0], ended[1].error_code), (state, code), ended[1].error_string)

    # -- goals that are reached -----------------------------------------------------------------------------------

    def test_goal_is_reached_with_feedback_on_the_way(self):
        feedback = []
        self.client.send_goal(goal((0.2, [0.2, -0.2]), (0.5, [0.5, -0.5])), feedback_cb=feedback.append)
        self.assertTrue(self.client.wait_for_result(rospy.Duration(WAIT_S)))
        self.assert_ended((self.client.get_state(), self.client.get_result()), GoalStatus.SUCCEEDED, R.SUCCESSFUL)
        self.assertEqual(self.client.get_result().error_string, "")
        self.wait_at(0.5, -0.5)
        self.assertGreater(len(feedback), 5)
        self.assertEqual(feedback[0].joint_names, JOINTS)

    def test_joints_come_in_any_order(self):
        self.assert_ended(self.go(goal((0.1, [0.3, 0.1]), names=["elbow", "shoulder"])), GoalStatus.SUCCEEDED, 0)
        self.wait_at(0.1, 0.3)

    def test_future_start_is_waited_for(self):
        # Later than this test needs for its next lines, and cancelled then.
        self.client.send_goal(goal((0.1, [0.3, 0.3]), start=rospy.Time.now() + rospy.Duration(60.0)))
        self.wait_active()
        active = self.state.header.stamp
        wait_until(lambda: self.state.header.stamp > active + rospy.Duration(0.3), "states while it waits")
        np.testing.assert_allclose(self.state.actual.positions, [0.0, 0.0], atol=1e-9)
        self.client.cancel_goal()
        self.assertTrue(self.client.wait_for_result(rospy.Duration(WAIT_S)))
        self.assertEqual(self.client.get_state(), GoalStatus.PREEMPTED)
        start = rospy.Time.now() + rospy.Duration(2.0)
        self.assert_ended(self.go(goal((0.1, [0.3, 0.3]), start=start)), GoalStatus.SUCCEEDED, R.SUCCESSFUL)
        self.assertGreaterEqual(rospy.Time.now(), start + rospy.Duration(0.09))
        self.wait_at(0.3, 0.3)

    def test_no_points_stop_and_succeed(self):
        self.command.publish(trajectory((2.0, [1.0, 1.0])))
        wait_until(lambda: any(self.state.desired.velocities), "the joints to move")
        self.assert_ended(self.go(goal()), GoalStatus.SUCCEEDED, R.SUCCESSFUL)
        self.assert_stands()

    def test_lagging_joint_arrives_within_the_goal_time(self):
        service("/robot/lag", SetBool, True)
        self.assert_ended(self.go(goal((0.2, [0.3, 0.3]))), GoalStatus.ABORTED, R.GOAL_TOLERANCE_VIOLATED)
        late = goal((0.2, [-0.3, -0.3]))
        late.goal_time_tolerance = rospy.Duration(3.0)
        self.assert_ended(self.go(late), GoalStatus.SUCCEEDED, R.SUCCESSFUL)

    # -- goals that are not accepted ------------------------------------------------------------------------------

    def test_goals_that_cannot_be_followed_are_rejected(self):
        past = rospy.Time.now() - rospy.Duration(100.0)
        for a_goal, code, text in (
                (goal((0.1, [0.1]), names=["elbow"]), R.INVALID_JOINTS, "lacks shoulder"),
                (goal((0.1, [0.1, 0.1]), names=["elbow", "x"]), R.INVALID_JOINTS, "unknown joint x"),
                (goal((0.1, []), names=[]), R.INVALID_JOINTS, "empty"),
                (goal((0.2, [0.1, 0.1]), (0.1, [0.1, 0.1])), R.INVALID_GOAL, "must increase"),
                (goal((0.2, [0.1])), R.INVALID_GOAL, "1 position, expected 2"),
                (goal((0.2, [0.1, float("nan")])), R.INVALID_GOAL, "finite"),
                (goal((0.2, [0.1, 0.1]), start=past), R.INVALID_GOAL, "in the past")):
            with self.subTest(text):
                ended = self.go(a_goal)
                self.assert_ended(ended, GoalStatus.REJECTED, code)
                self.assertIn(text, ended[1].error_string)

    def test_goals_are_rejected_while_the_controller_does_not_run(self):
        switch(stop=["arm"])
        try:
            self.assert_ended(self.go(goal((0.1, [0.1, 0.1]))), GoalStatus.REJECTED, R.INVALID_GOAL)
            with self.assertRaises(rospy.ServiceException):
                service("/robot/arm/query_state", QueryTrajectoryState, rospy.Time.now())
        finally:
            switch(start=["arm"])

    # -- goals that fail ------------------------------------------------------------------------------------------

    def test_frozen_joint_violates_the_path_tolerance(self):
        service("/robot/freeze", SetBool, True)
        ended = self.go(goal((1.0, [0.0, 1.0])))
        self.assert_ended(ended, GoalStatus.ABORTED, R.PATH_TOLERANCE_VIOLATED)
        self.assertRegex(ended[1].error_string, r"^elbow path error 0\.5\d+ \(position, tolerance 0\.5\) at 0\.5\d+ s$")

    def test_clipped_joint_violates_the_goal_tolerance(self):
        service("/robot/clip", SetBool, True)
        ended = self.go(goal((0.3, [0.0, 0.7])))
        self.assert_ended(ended, GoalStatus.ABORTED, R.GOAL_TOLERANCE_VIOLATED)
        self.assertRegex(ended[1].error_string,
                         r"^elbow goal error 0\.2\d+ \(position, tolerance 0\.01\) 0\.00\d s after the end$")
        # Unlike after a cancelled goal, the joints continue after a failed one.
        service("/robot/clip", SetBool, False)
        self.wait_at(0.0, 0.7)

    def test_goal_may_bring_its_own_tolerances(self):
        service("/robot/clip", SetBool, True)
        loose = goal((0.3, [0.0, 0.7]))
        loose.goal_tolerance = [JointTolerance("elbow", -1.0, -1.0, 0.0)]
        self.assert_ended(self.go(loose), GoalStatus.SUCCEEDED, R.SUCCESSFUL)
        tight = goal((0.3, [0.0, 0.9]))
        tight.path_tolerance = [JointTolerance("elbow", 0.05, 0.0, 0.0)]
        self.assert_ended(self.go(tight), GoalStatus.ABORTED, R.PATH_TOLERANCE_VIOLATED)

    # -- goals that are cancelled --------------------------------------------------------------------------------

    def ended_by(self, act, state=GoalStatus.PREEMPTED):
        """Start a long goal, ``act()``, and see that the goal ends so."""
        self.client.send_goal(goal((3.0, [1.0, 1.0])))
        self.wait_active()
        act()
        self.assertTrue(self.client.wait_for_result(rospy.Duration(WAIT_S)), "no result")
        self.assertEqual(self.client.get_state(), state)

    def test_cancelled_goal_stops_the_joints(self):
        self.ended_by(self.client.cancel_goal)
        self.assert_stands()

    def test_cancel_all_goals(self):
        self.ended_by(self.client.cancel_all_goals)
        self.assert_stands()

    def test_cancel_up_to_now(self):
        self.ended_by(lambda: self.client.cancel_goals_at_and_before_time(rospy.Time.now()))
        self.assert_stands()
        self.assert_ended(self.go(goal((0.05, [0.0, 0.0]))), GoalStatus.SUCCEEDED, 0)

    def test_goal_of_another_client_preempts(self):
        other = actionlib.SimpleActionClient(ACTION, FollowJointTrajectoryAction)
        self.assertTrue(other.wait_for_server(rospy.Duration(WAIT_S)))
        self.ended_by(lambda: other.send_goal(goal((0.1, [-0.1, -0.1]))))
        self.assertTrue(other.wait_for_result(rospy.Duration(WAIT_S)))
        self.assertEqual(other.get_state(), GoalStatus.SUCCEEDED)
        self.wait_at(-0.1, -0.1)

    def test_topic_command_preempts(self):
        self.ended_by(lambda: self.command.publish(trajectory((0.1, [-0.1, -0.1]))))
        self.wait_at(-0.1, -0.1)

    def test_wrong_topic_command_does_not(self):
        self.client.send_goal(goal((0.5, [0.5, 0.5])))
        self.wait_active()
        self.command.publish(trajectory((0.1, [9.0]), names=["elbow"]))
        self.assertTrue(self.client.wait_for_result(rospy.Duration(WAIT_S)))
        self.assertEqual(self.client.get_state(), GoalStatus.SUCCEEDED)

    def test_stopping_the_controller_ends_the_goal(self):
        try:
            self.ended_by(lambda: switch(stop=["arm"]))
        finally:
            switch(start=["arm"])
        self.assert_stands()

    def test_goal_that_its_cancel_request_overtook_is_recalled(self):
        results, statuses = [], []
        subscribers = [rospy.Subscriber(ACTION + "/result", FollowJointTrajectoryActionResult, results.append),
                       rospy.Subscriber(ACTION + "/status", GoalStatusArray, statuses.append)]
        goals = rospy.Publisher(ACTION + "/goal", FollowJointTrajectoryActionGoal, queue_size=1)
        cancels = rospy.Publisher(ACTION + "/cancel", GoalID, queue_size=1)
        wait_until(lambda: goals.get_num_connections() and cancels.get_num_connections()
                   and all(subscriber.get_num_connections() for subscriber in subscribers), "the action's topics")
        cancels.publish(GoalID(id="early"))
        wait_until(lambda: statuses and any(status.goal_id.id == "early" and status.status == GoalStatus.RECALLING
                                            for status in statuses[-1].status_list), "the request to be kept")
        message = FollowJointTrajectoryActionGoal(goal=goal((0.1, [0.5, 0.5])))
        message.goal_id.id = "early"
        goals.publish(message)
        wait_until(lambda: results, "a result")
        self.assertEqual((results[0].status.goal_id.id, results[0].status.status), ("early", GoalStatus.RECALLED))

    # -- the other interfaces -------------------------------------------------------------------------------------

    def test_query_tells_what_is_desired(self):
        self.command.publish(trajectory((2.0, [1.0, -1.0])))
        wait_until(lambda: any(self.state.desired.velocities), "the joints to move")
        response = service("/robot/arm/query_state", QueryTrajectoryState, rospy.Time.now() + rospy.Duration(10.0))
        self.assertEqual(list(response.name), JOINTS)
        np.testing.assert_allclose(response.position, [1.0, -1.0])
        np.testing.assert_allclose(response.velocity, [0.0, 0.0])
        with self.assertRaises(rospy.ServiceException):
            service("/robot/arm/query_state", QueryTrajectoryState, rospy.Time(1))

    def test_state_comes_fifty_times_a_second_and_is_exact(self):
        states = []
        subscriber = rospy.Subscriber("/robot/arm/state", JointTrajectoryControllerState, states.append)
        self.command.publish(trajectory((1.0, [0.5, -0.5])))
        wait_until(lambda: len(states) > 50, "states")
        subscriber.unregister()
        stamps = np.diff([state.header.stamp.to_sec() for state in states])
        self.assertAlmostEqual(float(np.median(stamps)), 0.02, delta=0.001)
        self.assertLess(max(abs(error) for state in states for error in state.error.positions), 1e-6)


if __name__ == "__main__":
    rospy.init_node("trajectory_controller_test")
    rostest.rosrun("ros_controllers", "trajectory_controller", TrajectoryControllerTest, sys.argv)
