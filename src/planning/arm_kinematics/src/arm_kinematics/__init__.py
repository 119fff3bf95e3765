# SPDX-License-Identifier: BSD-3-Clause
"""Kinematics of a serial arm: forward, Jacobian, inverse with reasons for failure. Free of ROS."""

from arm_kinematics.batch import BatchResult, solve_batch
from arm_kinematics.budget import Budget
from arm_kinematics.chain import Chain, wrench_from_torques
from arm_kinematics.collision import CollisionChecker, OwnBody, Touch
from arm_kinematics.errors import ChainError, InvalidPosture, InvalidTarget, KinematicsError, NoSolution, Reason
from arm_kinematics.ik import Several, solve, solve_all, solve_as_vendor, warm_up
from arm_kinematics.posture_map import PostureMap
from arm_kinematics.search import IkResult
from arm_kinematics.target import Target, Targets, pose_from_quaternion

__all__ = [
    "BatchResult",
    "Budget",
    "Chain",
    "ChainError",
    "CollisionChecker",
    "IkResult",
    "InvalidPosture",
    "InvalidTarget",
    "KinematicsError",
    "NoSolution",
    "OwnBody",
    "PostureMap",
    "Reason",
    "Several",
    "Target",
    "Targets",
    "Touch",
    "pose_from_quaternion",
    "solve",
    "solve_all",
    "solve_as_vendor",
    "solve_batch",
    "warm_up",
    "wrench_from_torques",
]
