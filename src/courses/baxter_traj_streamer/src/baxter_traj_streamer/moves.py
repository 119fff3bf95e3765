# SPDX-License-Identifier: BSD-3-Clause
"""Moves of the arms as trajectories from their present position: to a pose, along playfiles."""

from __future__ import annotations

from typing import TYPE_CHECKING

from . import playfile
from .ros_settings import read_limits
from .timing import arrival_times
from .traj_client import joint_trajectory

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import numpy as np
    from trajectory_msgs.msg import JointTrajectory

    from .traj_client import TrajClient


class PoseMove:
    """To a pose: ``trajectory(side, pose, time_optimal)``."""

    def __init__(self, client: TrajClient) -> None:
        self._client = client

    def trajectory(self, side: str, pose: str | Sequence[float] | np.ndarray,
                   time_optimal: bool = False) -> JointTrajectory:
        """``pose``: a name or seven angles [rad]. Raises SettingsError, ValueError."""
        streamer = self._client.streamer
        path = [streamer.get_qvec(side), streamer.settings.pose(pose, side) if isinstance(pose, str) else pose]
        trajectory = streamer.stuff_trajectory(path, side)
        return joint_trajectory(trajectory.joint_names, None, path) if time_optimal else trajectory


class PlayfileMove:
    """To the first row of playfiles and along them: ``trajectory(files, time_optimal)``."""

    def __init__(self, client: TrajClient) -> None:
        self._client = client
        self._limits = read_limits()

    def check(self, files: Mapping[str, playfile.Playfile]) -> None:
        """Check {side: Playfile} as the server would. Raises PlayfileError."""
        playfile.check(files, self._limits, self._client.streamer.settings)

    def trajectory(self, files: Mapping[str, playfile.Playfile], time_optimal: bool = False) -> JointTrajectory:
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
