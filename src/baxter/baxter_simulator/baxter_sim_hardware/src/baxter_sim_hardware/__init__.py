# SPDX-License-Identifier: BSD-3-Clause
"""The behaviour of the simulated Baxter, without ROS: the state table, command modes and time-outs, end-point forces.

`plugin.BaxterPlugin` runs it in a world; it is not imported here, because it needs ROS.
"""
from .arms.control import Arms
from .arms.drives import Drives
from .arms.joint_command import JointLimits, Mode
from .errors import CommandRefused, HardwareError
from .robot import Baxter
from .robot_state import Event, RobotState, State

__all__ = [
    "Arms", "Baxter", "CommandRefused", "Drives", "Event", "HardwareError", "JointLimits", "Mode", "RobotState",
    "State",
]
