# SPDX-License-Identifier: BSD-3-Clause
"""Moves along a straight line from the arms' present position. A separate module, because its imports take a second."""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import rospy

import urdf_model
from arm_kinematics import Chain
from baxter_model import BASE_FRAME, tip_of

from .ros_settings import read_limits
from .settings import SIDES, StreamerSettingsError, arm_joint_names
from .straight_line import straight_line
from .traj_client import joint_trajectory

if TYPE_CHECKING:
    from collections.abc import Sequence

    from trajectory_msgs.msg import JointTrajectory

    from .traj_client import TrajClient


class LineMove:
    """The tip along a straight line, its orientation kept: ``trajectory(side, displacement, speed)``.

    Raises StreamerSettingsError without robot_description, ChainError or UrdfError if it has no gripper.
    """

    def __init__(self, client: TrajClient) -> None:
        self._client = client
        if not rospy.has_param("robot_description"):
            raise StreamerSettingsError("the parameter robot_description is not set; the arms' kinematics are read "
                                        "from it")
        robot = urdf_model.parse_urdf(str(rospy.get_param("robot_description")), source="robot_description")
        self._chains = {side: Chain.from_robot(robot, BASE_FRAME, tip_of(side)) for side in SIDES}
        self._limits = read_limits()

    def trajectory(self, side: str, displacement: Sequence[float] | np.ndarray, speed: float = 0.0) -> JointTrajectory:
        """``displacement`` (3,) [m] in base; ``speed`` [m/s], 0: the settings'. Raises LeavesReach, ValueError."""
        settings = self._client.streamer.settings
        if not 0.0 <= speed < np.inf:
            raise ValueError("the speed must be above 0 m/s, or 0 for that of the settings; got %r" % speed)
        names = arm_joint_names(side)
        line = straight_line(self._chains[side], self._client.here(names), displacement)
        velocity = np.minimum(settings.planning_velocity(), [self._limits[name].velocity for name in names])
        acceleration = [settings.max_acceleration[name.rpartition("_")[2]] for name in names]
        return joint_trajectory(names, *line.timed(velocity, np.array(acceleration), speed or settings.cartesian_speed))
