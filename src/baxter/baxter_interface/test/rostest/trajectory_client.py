# SPDX-License-Identifier: BSD-3-Clause
"""A trajectory client for tests, written from the action's public description; it counts the ends of its goals."""
import collections

import actionlib
import rospy
from control_msgs.msg import FollowJointTrajectoryAction, FollowJointTrajectoryActionResult, FollowJointTrajectoryGoal
from trajectory_msgs.msg import JointTrajectoryPoint

JOINTS = ("s0", "s1", "e0", "e1", "w0", "w1", "w2")
# Time limit of steps that take seconds [s, ROS time; wall time for the start of a server].
DEADLINE_S = 60.0


class TrajectoryClient:
    def __init__(self, limb):
        self.names = ["%s_%s" % (limb, joint) for joint in JOINTS]
        self.feedback = []
        self.ends = collections.Counter()
        topic = "robot/limb/%s/follow_joint_trajectory" % limb
        self._results = rospy.Subscriber(topic + "/result", FollowJointTrajectoryActionResult, self._on_result)
        self._client = actionlib.SimpleActionClient(topic, FollowJointTrajectoryAction)
        if not self._client.wait_for_server(rospy.Duration(DEADLINE_S)):
            raise AssertionError("no trajectory server on %s" % topic)

    def _on_result(self, message):
        self.ends[message.status.goal_id.id] += 1

    def send(self, points, names=None, stamp=None, **fields):
        """points: rows of (time, positions[, velocities[, accelerations]])."""
        goal = FollowJointTrajectoryGoal(**fields)
        goal.trajectory.joint_names = self.names if names is None else names
        goal.trajectory.points = [
            JointTrajectoryPoint(*row[1:], *[[]] * (5 - len(row)), rospy.Duration.from_sec(row[0])) for row in points]
        if stamp is not None:
            goal.trajectory.header.stamp = stamp
        self.feedback = []
        self._client.send_goal(goal, feedback_cb=self.feedback.append)

    def cancel(self):
        self._client.cancel_goal()

    def end(self):
        """Wait for the end of the last goal: (state, error code, error string)."""
        if not self._client.wait_for_result(rospy.Duration(DEADLINE_S)):
            raise AssertionError("the goal has not ended within %g s" % DEADLINE_S)
        result = self._client.get_result()
        return self._client.get_state(), result.error_code, result.error_string

    def go(self, *arguments, **fields):
        self.send(*arguments, **fields)
        return self.end()
