# SPDX-License-Identifier: BSD-3-Clause
"""Controllers that share a robot's joints: their base class, and which of them may run. ROS-free.

Only ``pid_tuning``, ``services``, ``controller_manager_interface`` and ``controller_lifetime`` know ROS.
"""
from .controller import Controller, ControllerContext
from .controller_table import ControllerTable
from .errors import ControlError, ControllerError, HardwareError, Refused
from .hardware import RobotHardware, SwitchResult
from .interfaces import EFFORT, JOINT_STATE, POS_VEL, POS_VEL_ACC, POSITION, VELOCITY
from .pid import Gains, Pid

__all__ = [
    "EFFORT",
    "JOINT_STATE",
    "POSITION",
    "POS_VEL",
    "POS_VEL_ACC",
    "VELOCITY",
    "ControlError",
    "Controller",
    "ControllerContext",
    "ControllerError",
    "ControllerTable",
    "Gains",
    "HardwareError",
    "Pid",
    "Refused",
    "RobotHardware",
    "SwitchResult",
]
