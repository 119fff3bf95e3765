# SPDX-License-Identifier: BSD-3-Clause
"""Forward kinematics of links, and inverse kinematics of groups, with the reason of a failure."""
from motion_planning.kinematics.inverse import KinematicsFailure, NoIkSolution, fk, ik
from motion_planning.kinematics.limb import GroupLimb, limbs_of

__all__ = ["KinematicsFailure", "GroupLimb", "NoIkSolution", "fk", "ik", "limbs_of"]
