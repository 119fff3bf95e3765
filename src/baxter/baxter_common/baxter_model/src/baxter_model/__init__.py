# SPDX-License-Identifier: BSD-3-Clause
"""Facts of the Baxter robot, each in one place: names, mirror signs, poses, grippers. Free of ROS.

`self_collision` says which links can touch, and `description` reads facts from the robot's URDF; both are imported
by programs that need them, so that `import baxter_model` stays cheap.
"""
from .errors import BaxterModelError, ModelMismatch, PoseError
from .grippers import CUSTOM, ELECTRIC, SUCTION, GripperKind
from .names import (
    BASE_FRAME,
    BASE_HEIGHT_M,
    HEAD_JOINT,
    JOINTS,
    MIRROR_SIGNS,
    SIDES,
    arm_angles,
    finger_prefix,
    is_part_of_arm,
    joint_names,
    mirrored,
    named,
    other_side,
    tip_of,
)
from .poses import Poses, clamp_to_limits, null_space_postures, poses

__all__ = [
    "BASE_FRAME", "BASE_HEIGHT_M", "CUSTOM", "ELECTRIC", "HEAD_JOINT", "JOINTS", "MIRROR_SIGNS", "SIDES", "SUCTION",
    "GripperKind", "BaxterModelError", "ModelMismatch", "PoseError", "Poses", "arm_angles", "clamp_to_limits",
    "finger_prefix", "is_part_of_arm", "joint_names", "mirrored", "named", "null_space_postures",
    "other_side", "poses", "tip_of",
]
