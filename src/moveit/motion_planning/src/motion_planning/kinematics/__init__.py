# SPDX-License-Identifier: BSD-3-Clause
"""Where links are, and which joint values of a group put its links somewhere, with the reason where none do."""
from motion_planning.kinematics.inverse import KinematicsFailure, NoIkSolution, fk, ik
from motion_planning.kinematics.limb import Limb, limbs_of

__all__ = ["KinematicsFailure", "Limb", "NoIkSolution", "fk", "ik", "limbs_of"]
