# SPDX-License-Identifier: BSD-3-Clause
"""Compiled inner loops: forward kinematics, Jacobian, and the search behind :func:`baxter_sim_kinematics.solve`.

An ``arm`` of n joints is a tuple of arrays, every joint turned so that it moves about (or along) its own z axis:

- rotations (n + 1, 3, 3) and offsets (n + 1, 3) [m]: the constant pose of joint i's frame in the frame that joint i - 1
  moves; the last entry leads from the last joint to the tip;
- prismatic (n,) bool.

``limits`` are (lower, upper), (n,) each [rad or m], infinite where there is no limit. A ``target`` is (rotation
(3, 3), position (3,), rows, basis (3, 3)): ``rows`` of the pose error count, 6 all of it; 5 all but a turn about one
axis; 3 the position alone; ``basis`` says which axis is free, see :func:`fill_basis`. ``tolerances`` are ([m], [rad]).

Positions are in metres and angles in radians, everything in the base frame. The functions keep no state and release the
GIL, so any number of threads may call them.
"""
from baxter_sim_kinematics.kernels.descent import nearest
from baxter_sim_kinematics.kernels.linear import wrench
from baxter_sim_kinematics.kernels.motion import joint_frames, tip_and_jacobian
from baxter_sim_kinematics.kernels.searching import gather, search, search_many
from baxter_sim_kinematics.kernels.task import beyond_reach, fill_basis, pose_error, split_pose

__all__ = ["beyond_reach", "fill_basis", "gather", "joint_frames", "nearest", "pose_error", "search", "search_many",
           "split_pose", "tip_and_jacobian", "wrench"]
