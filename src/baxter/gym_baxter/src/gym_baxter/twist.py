# SPDX-License-Identifier: BSD-3-Clause
"""Compiled: the joints of an arm after its hand has moved by a twist."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from arm_kinematics.kernels import linear, motion
from disk_cache.compiled import compiler

if TYPE_CHECKING:
    from arm_kinematics.kernels import Arm, Limits

_compiled = compiler("gym_baxter", [__file__, linear.__file__, motion.__file__], error_model="numpy")

#: Two steps of damped least squares: away from singularities the rest is less than a millimetre.
STEPS = 2
_STILL = 1e-9


@_compiled
def _fill_difference(goal: np.ndarray, pose: np.ndarray, error: np.ndarray) -> None:
    """Fill error (6,) with shift and turn from one pose to another [m, rad]: the turn is axis times angle."""
    turned = np.zeros((3, 3))
    for i in range(3):
        error[i] = goal[i, 3] - pose[i, 3]
        for j in range(3):
            for k in range(3):
                turned[i, j] += goal[i, k] * pose[j, k]
    error[3] = 0.5 * (turned[2, 1] - turned[1, 2])
    error[4] = 0.5 * (turned[0, 2] - turned[2, 0])
    error[5] = 0.5 * (turned[1, 0] - turned[0, 1])
    sine = linear.length(error, 3, 6)
    cosine = 0.5 * (turned[0, 0] + turned[1, 1] + turned[2, 2] - 1.0)
    factor = math.atan2(sine, cosine) / sine if sine > _STILL else 0.0
    for i in range(3, 6):
        error[i] *= factor


@_compiled
def _turn(pose: np.ndarray, vector: np.ndarray) -> None:
    """Turn a pose (4, 4) in place about `vector` (3,), axis times angle [rad], in the base frame (Rodrigues)."""
    angle = linear.length(vector, 0, 3)
    if angle <= _STILL:
        return
    before, axis = pose[:3, :3].copy(), vector / angle
    sine, cosine = math.sin(angle), math.cos(angle)
    for column in range(3):
        along = 0.0
        for i in range(3):
            along += axis[i] * before[i, column]
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            across = axis[j] * before[k, column] - axis[k] * before[j, column]
            pose[i, column] = cosine * before[i, column] + sine * across + (1.0 - cosine) * along * axis[i]


@_compiled
def after(arm: Arm, limits: Limits, q: np.ndarray, twist: np.ndarray, damping: float) -> np.ndarray:
    """(n,) joints [rad] after the hand's pose at `q` (n,) has moved by `twist` (6,), shift [m] and turn [rad], in the
    base frame. arm, limits: as for `arm_kinematics.kernels`; damping: as of damped least squares [m]."""
    rotations, offsets, prismatic = arm
    goal, jacobian = motion.tip_and_jacobian(rotations, offsets, prismatic, q)
    goal[:3, 3] += twist[:3]
    _turn(goal, twist[3:])
    error, gram, q = np.empty(6), np.empty((6, 6)), q.copy()
    for _ in range(STEPS):
        pose, jacobian = motion.tip_and_jacobian(rotations, offsets, prismatic, q)
        _fill_difference(goal, pose, error)
        linear.fill_gram(jacobian, 6, damping * damping, gram)
        linear.factorise(gram, 6)
        linear.back_substitute(gram, 6, error)
        for joint in range(len(q)):
            step = 0.0
            for row in range(6):
                step += jacobian[row, joint] * error[row]
            q[joint] = min(max(q[joint] + step, limits[0][joint]), limits[1][joint])
    return q
