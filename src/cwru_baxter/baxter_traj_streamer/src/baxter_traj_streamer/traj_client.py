# SPDX-License-Identifier: BSD-3-Clause
"""Sends trajectories to trajActionServer, and waits for whatever is not up yet."""
import time

import actionlib
import rospy
from actionlib_msgs.msg import GoalStatus
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from .interpolator import ACTION_NAME
from .msg import trajAction, trajGoal
from .streamer import BaxterTrajStreamer

# How often it is said again what is waited for [s].
REMINDER_S = 5.0


class MoveFailed(Exception):
    """A goal that was not reached; the text says why. ``status``: of actionlib_msgs/GoalStatus."""

    def __init__(self, status, text):
        super().__init__("the goal ended as %s: %s" % (GoalStatus.to_string(status), text))
        self.status = status


class TrajClient:
    """A robot's arms and the server that moves them; ``streamer`` is the library for paths.

    Raises what BaxterTrajStreamer raises.
    """

    def __init__(self):
        self.streamer = BaxterTrajStreamer()
        self._action = actionlib.SimpleActionClient(ACTION_NAME, trajAction)

    def wait_until_ready(self):
        """Wait for the server and for the robot to be enabled, whatever was started first, and say what for."""
        while not self._action.wait_for_server(rospy.Duration(REMINDER_S)) and not rospy.is_shutdown():
            rospy.logwarn("waiting for %s: rosrun baxter_traj_streamer traj_interpolator_as", ACTION_NAME)
        while (why := self.streamer.robot.why_not_ready()) and not rospy.is_shutdown():
            rospy.logwarn_throttle(REMINDER_S, "waiting: %s" % why)
            time.sleep(0.1)

    def send(self, trajectory, traj_id=1):
        """Send a JointTrajectory. The arms move on when this program ends; see the setting stop_when_client_leaves."""
        self._action.send_goal(trajGoal(trajectory=trajectory, traj_id=traj_id))

    def cancel(self):
        """Stop the goal that was sent."""
        self._action.cancel_goal()

    def wait(self, timeout_s=None):
        """Wait [s, None: as long as it takes]; the result, or None if the time is over. Raises MoveFailed."""
        timeout = rospy.Duration(timeout_s) if timeout_s is not None else rospy.Duration()
        if not self._action.wait_for_result(timeout):
            return None
        status = self._action.get_state()
        if status != GoalStatus.SUCCEEDED:
            raise MoveFailed(status, self._action.get_goal_status_text())
        return self._action.get_result()

    def here(self, joint_names):
        """The measured angles [rad] of these joints. Raises KeyError for one that the robot does not report."""
        angles = self.streamer.robot.angles()
        return [angles[name] for name in joint_names]


def joint_trajectory(joint_names, times, positions, velocities=None):
    """The message: ``times`` (m,) [s], or None to leave them to the server, ``positions``, ``velocities`` (m, k)."""
    trajectory = JointTrajectory(joint_names=list(joint_names))
    for index, row in enumerate(positions):
        point = JointTrajectoryPoint(positions=list(row))
        if times is not None:
            point.time_from_start = rospy.Duration.from_sec(float(times[index]))
        if velocities is not None:
            point.velocities = list(velocities[index])
        trajectory.points.append(point)
    return trajectory
