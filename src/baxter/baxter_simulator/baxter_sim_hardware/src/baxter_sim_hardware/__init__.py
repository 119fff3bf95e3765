# SPDX-License-Identifier: BSD-3-Clause
"""What makes Baxter Baxter, without ROS: the state table, command modes and time-outs, end-point forces.

`plugin.BaxterPlugin` brings it into a world; it is not imported here, because it needs ROS.
"""
from .arms.control import Arms, Drives
from .arms.joint_command import JointLimits, Mode
from .errors import CommandRefused, HardwareError
from .robot import Baxter
from .robot_state import Event, RobotState, State

__all__ = [
    "Arms", "Baxter", "CommandRefused", "Drives", "Event", "HardwareError", "JointLimits", "Mode", "RobotState",
    "State",
]
