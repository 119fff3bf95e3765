# SPDX-License-Identifier: BSD-3-Clause
"""Send trajectories to an arm's action server."""
from __future__ import annotations

from collections.abc import Sequence

import rospy
from control_msgs.msg import FollowJointTrajectoryAction, FollowJointTrajectoryGoal
from trajectory_msgs.msg import JointTrajectoryPoint

from baxter_interface.joint_checks import limb_joint_names

from .action_client import ActionClient

SERVER_COMMAND = "rosrun baxter_interface joint_trajectory_action_server.py"
GOAL_TIME_S = 0.1


class TrajectoryClient(ActionClient):
    """A trajectory for one arm, built point by point. Raises ProgramFailed if there is no server."""

    def __init__(self, side: str) -> None:
        super().__init__("robot/limb/%s/follow_joint_trajectory" % side, FollowJointTrajectoryAction, SERVER_COMMAND)
        self._side = side
        self._goal_time_s = GOAL_TIME_S
        self.clear()

    def clear(self) -> None:
        """Begin a new trajectory."""
        self._goal = FollowJointTrajectoryGoal()
        self._goal.trajectory.joint_names = limb_joint_names(self._side)
        self._points: list[JointTrajectoryPoint] = []
        self._goal.trajectory.points = self._points

    def set_goal_time(self, goal_time_s: float) -> None:
        """Set the time that the arm may take to arrive after the last point [s]."""
        self._goal_time_s = goal_time_s

    def add(self, time_s: float, angles: Sequence[float]) -> None:
        """Add a point `time_s` after the start: angles [rad] from shoulder to wrist."""
        self._points.append(JointTrajectoryPoint(
            positions=list(angles), time_from_start=rospy.Duration.from_sec(time_s)))

    def send(self) -> None:
        """Send the trajectory; it begins at once."""
        self._goal.goal_time_tolerance = rospy.Duration.from_sec(self._goal_time_s)
        super().send(self._goal)
