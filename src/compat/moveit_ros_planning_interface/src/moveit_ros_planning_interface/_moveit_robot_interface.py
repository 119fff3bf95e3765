# SPDX-License-Identifier: BSD-3-Clause
"""The robot, with messages as bytes."""
from __future__ import annotations

from moveit_commander import RobotCommander
from moveit_commander.wrapped import WrappedRobot


class RobotInterface(WrappedRobot):
    """The parameters are RobotCommander's. Raises RuntimeError without a description."""

    def __init__(self, robot_description: str = "robot_description", ns: str = "") -> None:
        super().__init__(RobotCommander(robot_description, ns))
