# SPDX-License-Identifier: BSD-3-Clause
"""Compiled inner loops: forward kinematics, Jacobian, and the search behind :func:`baxter_sim_kinematics.solve`.

Arrays and numbers that belong together are a plain tuple: passing it from Python to numba takes a third of the time of
a named one. Their parts, in order:

- arm, n joints, each turned so that it moves about (or along) its own z axis: rotations (n + 1, 3, 3) and offsets
  (n + 1, 3) [m], the constant pose of joint i's frame in the frame that joint i - 1 moves, the last entry from the last
  joint to the tip; prismatic (n,) bool;
- limits: lower, upper (n,) [rad or m], infinite where there is no limit;
- target: rotation (3, 3), position (3,), rows: the value of a :class:`Rows`, basis (3, 3): the free axis, see
  :func:`fill_basis`;
- effort: tolerances [m], [rad], iterations of one start, starts, number of starts that must arrive before a search
  ends;
- postures: seed (n,), where a search starts, and preferred (n,), which solutions should be near;
- collection, how :func:`gather` fills its rows: number of filled rows; number of the first start; whether each solution
  moves along its self-motion to the point nearest the preferred posture; least difference of two solutions in some
  joint [rad or m].

Positions are in metres and angles in radians, everything in the base frame. The functions keep no state and release the
GIL, so any number of threads may call them.
"""
from baxter_sim_kinematics.kernels.descent import nearest, newton
from baxter_sim_kinematics.kernels.linear import wrench
from baxter_sim_kinematics.kernels.motion import joint_frames, tip_and_jacobian
from baxter_sim_kinematics.kernels.rows import Rows
from baxter_sim_kinematics.kernels.searching import gather, search, search_many
from baxter_sim_kinematics.kernels.task import beyond_reach, fill_basis, pose_error, split_pose

__all__ = ["Rows", "beyond_reach", "fill_basis", "gather", "joint_frames", "nearest", "newton", "pose_error", "search",
           "search_many", "split_pose", "tip_and_jacobian", "wrench"]
