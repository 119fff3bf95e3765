# SPDX-License-Identifier: BSD-3-Clause
"""The Baxter SDK's Python interface."""
from .analog_io import AnalogIO
from .camera import CameraController
from .digital_io import DigitalIO
from .gripper import Gripper
from .head import Head
from .joint_checks import UnknownNameError
from .limb import Limb, NoIKSolution
from .navigator import Navigator
from .robot_enable import RobotEnable
from .robust_controller import RobustController
from .settings import (
    CHECK_VERSION,
    HEAD_PAN_ANGLE_TOLERANCE,
    JOINT_ANGLE_TOLERANCE,
    SDK_VERSION,
    VERSIONS_SDK2GRIPPER,
    VERSIONS_SDK2ROBOT,
)
from .version_check import VersionMismatch

__all__ = [
    "AnalogIO",
    "CHECK_VERSION",
    "CameraController",
    "DigitalIO",
    "Gripper",
    "HEAD_PAN_ANGLE_TOLERANCE",
    "Head",
    "JOINT_ANGLE_TOLERANCE",
    "Limb",
    "Navigator",
    "NoIKSolution",
    "RobotEnable",
    "RobustController",
    "SDK_VERSION",
    "UnknownNameError",
    "VERSIONS_SDK2GRIPPER",
    "VERSIONS_SDK2ROBOT",
    "VersionMismatch",
]
