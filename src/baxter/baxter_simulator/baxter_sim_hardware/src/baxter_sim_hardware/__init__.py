# SPDX-License-Identifier: BSD-3-Clause
"""What makes Baxter Baxter, without ROS: the state table, command modes and time-outs, poses, end-point forces.

`plugin.BaxterPlugin` brings it into a world; it is not imported here, because it needs ROS.
"""
from .arms import Arms, Drives, LimbModel
from .errors import CommandRefused, HardwareError, ModelMismatch, PoseError
from .joint_command import JOINT_SUFFIXES, JointLimits, Mode
from .poses import Poses, clamp_to_limits
from .robot import Baxter
from .robot_state import Event, RobotState, State

__all__ = [
    "Arms", "Baxter", "CommandRefused", "Drives", "Event", "HardwareError", "JOINT_SUFFIXES", "JointLimits",
    "LimbModel", "Mode", "ModelMismatch", "PoseError", "Poses", "RobotState", "State", "clamp_to_limits",
]
