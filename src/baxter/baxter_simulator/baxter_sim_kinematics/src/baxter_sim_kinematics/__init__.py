# SPDX-License-Identifier: BSD-3-Clause
"""Kinematics of a serial arm: forward, Jacobian, inverse with reasons for failure. Free of ROS."""

from baxter_sim_kinematics.chain import Chain, wrench_from_torques
from baxter_sim_kinematics.errors import ChainError, InvalidPosture, InvalidTarget, KinematicsError, NoSolution, Reason
from baxter_sim_kinematics.ik import IkResult, pose_from_quaternion, solve, warm_up
from baxter_sim_kinematics.posture_map import PostureMap

__all__ = [
    "Chain",
    "ChainError",
    "IkResult",
    "InvalidPosture",
    "InvalidTarget",
    "KinematicsError",
    "NoSolution",
    "PostureMap",
    "Reason",
    "pose_from_quaternion",
    "solve",
    "warm_up",
    "wrench_from_torques",
]
