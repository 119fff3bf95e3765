# SPDX-License-Identifier: BSD-3-Clause
"""The library of the notes: poses of the arms, paths turned into trajectories, and both sent to the robot."""
from __future__ import annotations

import functools
import math
from typing import TYPE_CHECKING

import rospy
from baxter_core_msgs.msg import JointCommand
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from baxter_interface import startup

from . import timing
from .robot_link import RobotLink
from .ros_settings import read_settings
from .settings import JOINTS, SIDES, arm_joint_names

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np

    from baxter_traj_streamer.settings import StreamerSettings


def stuff_trajectory(qvecs: Sequence[Sequence[float]] | np.ndarray, side: str,
                     settings: StreamerSettings) -> JointTrajectory:
    """The JointTrajectory of one arm along the 7-vectors ``qvecs``; the first point is due at 0 s.

    Raises ValueError for an empty path or vectors that are not seven finite numbers.
    """
    if not len(qvecs):
        raise ValueError("the path has no poses; it needs at least one")
    for index, qvec in enumerate(qvecs):
        if len(qvec) != len(JOINTS) or not all(map(math.isfinite, qvec)):
            raise ValueError("pose %d must be %d finite numbers, got %s" % (index, len(JOINTS), list(qvec)))
    times = timing.arrival_times(qvecs, settings.planning_velocity(), settings.min_segment_s)
    trajectory = JointTrajectory(joint_names=arm_joint_names(side))
    trajectory.header.stamp = rospy.Time.now()
    trajectory.points = [
        JointTrajectoryPoint(positions=list(qvec), time_from_start=rospy.Duration.from_sec(time))
        for qvec, time in zip(qvecs, times, strict=True)]
    return trajectory


class BaxterTrajStreamer:
    """The member functions that the notes name, for both arms. 7-vectors go from torso to tool flange, in rad.

    Waits for the robot. Raises OSError with errno ETIMEDOUT if it does not come up, SettingsError, and
    rospy.ROSInitException before rospy.init_node.
    """

    def __init__(self) -> None:
        self.settings = read_settings()
        self.robot = RobotLink()
        self._command_publishers, self._path_publishers = {}, {}
        for side in SIDES:
            self._command_publishers[side] = rospy.Publisher(
                "/robot/limb/%s/joint_command" % side, JointCommand, queue_size=1, tcp_nodelay=True)
            self._path_publishers[side] = rospy.Publisher(
                "%s_arm_joint_path_command" % side, JointTrajectory, queue_size=1)
        self.robot.wait()
        for publisher in self._command_publishers.values():
            startup.wait_for_subscribers(publisher)

    def get_qvec(self, side: str) -> list[float]:
        """The seven measured angles of one arm."""
        angles = self.robot.angles()
        return [angles[name] for name in arm_joint_names(side)]

    def transition_time(self, dqvec: Sequence[float] | np.ndarray) -> float:
        """Shortest time [s] for a move of the seven joints by `dqvec`; see timing.transition_time."""
        return timing.transition_time(dqvec, self.settings.planning_velocity())

    def stuff_trajectory(self, qvecs: Sequence[Sequence[float]] | np.ndarray, side: str = "right") -> JointTrajectory:
        """Turn a path, a list of 7-vectors, into a JointTrajectory of one arm; see :func:`stuff_trajectory`."""
        return stuff_trajectory(qvecs, side, self.settings)

    def cmd_pose(self, qvec: Sequence[float] | np.ndarray, side: str) -> None:
        """Command one arm's joints once, in position mode, and return at once."""
        self._command_publishers[side].publish(JointCommand(
            mode=JointCommand.POSITION_MODE, names=arm_joint_names(side), command=list(qvec)))

    def pub_arm_trajectory(self, trajectory: JointTrajectory, side: str) -> None:
        """Publish a trajectory on <side>_arm_joint_path_command; goals of trajActionServer are the better way."""
        self._path_publishers[side].publish(trajectory)

    # The notes' names.
    get_qvec_right_arm = functools.partialmethod(get_qvec, "right")
    get_qvec_left_arm = functools.partialmethod(get_qvec, "left")
    stuff_trajectory_right_arm = functools.partialmethod(stuff_trajectory, side="right")
    stuff_trajectory_left_arm = functools.partialmethod(stuff_trajectory, side="left")
    cmd_pose_right = functools.partialmethod(cmd_pose, side="right")
    cmd_pose_left = functools.partialmethod(cmd_pose, side="left")
    pub_right_arm_trajectory = functools.partialmethod(pub_arm_trajectory, side="right")
    pub_left_arm_trajectory = functools.partialmethod(pub_arm_trajectory, side="left")
