# SPDX-License-Identifier: BSD-3-Clause
"""Moves of the arms as trajectories from where they are: to a pose, along playfiles, along a straight line."""
import numpy as np
import rospy

import urdf_model
from baxter_sim_kinematics import Chain

from . import playfile
from .ros_settings import read_limits
from .settings import SIDES, SettingsError, arm_joint_names
from .straight_line import straight_line
from .timing import arrival_times
from .traj_client import joint_trajectory

# Frame of the displacements.
BASE = "base"


class PoseMove:
    """To a pose: ``trajectory(side, pose, time_optimal)``."""

    def __init__(self, client):
        self._client = client

    def trajectory(self, side, pose, time_optimal=False):
        """``pose``: a name from config/streamer.yaml or seven angles [rad]. Raises SettingsError, ValueError."""
        streamer = self._client.streamer
        path = [streamer.get_qvec(side), streamer.settings.pose(pose, side) if isinstance(pose, str) else pose]
        trajectory = streamer.stuff_trajectory(path, side)
        return joint_trajectory(trajectory.joint_names, None, path) if time_optimal else trajectory


class PlayfileMove:
    """To the first row of playfiles and along them: ``trajectory(files, time_optimal)``."""

    def __init__(self, client):
        self._client = client
        self._limits = read_limits()

    def check(self, files):
        """Judge {side: Playfile} as the server would. Raises PlayfileError."""
        playfile.check(files, self._limits, self._client.streamer.settings)

    def trajectory(self, files, time_optimal=False):
        """``files``: {side: Playfile}, both begin at their first rows together. Raises PlayfileError."""
        self.check(files)
        names, times, positions = playfile.merged(files)
        here = self._client.here(names)
        if time_optimal:
            return joint_trajectory(names, None, [here, *positions])
        settings = self._client.streamer.settings
        approach = arrival_times([here, positions[0]], settings.planning_velocity() * len(files),
                                 settings.min_segment_s)[1]
        return joint_trajectory(names, [0.0, *(times + approach)], [here, *positions])


class LineMove:
    """The tip along a straight line, its orientation kept: ``trajectory(side, displacement, speed)``.

    Raises SettingsError without robot_description, ChainError or UrdfError where that has no gripper.
    """

    def __init__(self, client):
        self._client = client
        if not rospy.has_param("robot_description"):
            raise SettingsError("the parameter robot_description is not set; the arms' kinematics are read from it")
        robot = urdf_model.parse_urdf(rospy.get_param("robot_description"), source="robot_description")
        self._chains = {side: Chain.from_robot(robot, BASE, "%s_gripper" % side) for side in SIDES}
        self._limits = read_limits()

    def trajectory(self, side, displacement, speed=0.0):
        """``displacement`` (3,) [m] in base; ``speed`` [m/s], 0: the settings'. Raises LeavesReach, ValueError."""
        settings = self._client.streamer.settings
        if not 0.0 <= speed < np.inf:
            raise ValueError("the speed must be above 0 m/s, or 0 for that of the settings; got %r" % speed)
        names = arm_joint_names(side)
        line = straight_line(self._chains[side], self._client.here(names), displacement)
        velocity = np.minimum(settings.planning_velocity(), [self._limits[name].velocity for name in names])
        acceleration = [settings.max_acceleration[name.rpartition("_")[2]] for name in names]
        return joint_trajectory(names, *line.timed(velocity, np.array(acceleration), speed or settings.cartesian_speed))
