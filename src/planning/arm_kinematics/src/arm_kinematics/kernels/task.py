# SPDX-License-Identifier: BSD-3-Clause
"""The target of the tip, and the pose error."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from arm_kinematics.kernels.compiled import compiled
from arm_kinematics.kernels.linear import length
from arm_kinematics.kernels.motion import fill_jacobian, place_joints
from arm_kinematics.kernels.rows import Rows

if TYPE_CHECKING:
    from arm_kinematics.kernels import Arm, TargetArrays


@compiled
def split_pose(pose: np.ndarray, allowed: float, rotation: np.ndarray, position: np.ndarray) -> bool:
    """Copy a pose (4, 4) into ``rotation`` (3, 3), made exactly orthonormal, and ``position`` (3,).

    Returns False when a number is not finite, the rotation is off by more than ``allowed`` in any product of columns,
    or the last row is not 0 0 0 1, as that of a transposed pose.
    """
    gram, rounded = np.empty((3, 3)), np.empty((3, 3))
    for a in range(3):
        position[a] = pose[a, 3]
        for b in range(3):
            rotation[a, b] = pose[a, b]
    if not math.isfinite(position[0] + position[1] + position[2]):
        return False
    for b in range(4):
        if not abs(pose[3, b] - (1.0 if b == 3 else 0.0)) <= 1e-9:
            return False
    while True:
        error = 0.0
        for a in range(3):
            for b in range(3):
                gram[a, b] = (rotation[0, a] * rotation[0, b] + rotation[1, a] * rotation[1, b]
                              + rotation[2, a] * rotation[2, b])
                off = abs(gram[a, b] - (1.0 if a == b else 0.0))
                if not off <= allowed:
                    return False
                error = max(error, off)
        if error < 1e-12:
            break
        # Newton's iteration for the nearest rotation; each round squares the error.
        for a in range(3):
            for b in range(3):
                rounded[a, b] = 1.5 * rotation[a, b] - 0.5 * (
                    rotation[a, 0] * gram[0, b] + rotation[a, 1] * gram[1, b] + rotation[a, 2] * gram[2, b])
        rotation[:] = rounded
    determinant = (rotation[0, 0] * (rotation[1, 1] * rotation[2, 2] - rotation[1, 2] * rotation[2, 1])
                   - rotation[0, 1] * (rotation[1, 0] * rotation[2, 2] - rotation[1, 2] * rotation[2, 0])
                   + rotation[0, 2] * (rotation[1, 0] * rotation[2, 1] - rotation[1, 1] * rotation[2, 0]))
    return determinant > 0.0


@compiled
def fill_basis(target_rotation: np.ndarray, axis: np.ndarray, basis: np.ndarray) -> None:
    """Fill ``basis`` (3, 3): its last row is the target's ``axis`` (3,), given in the tip's frame, the others complete
    the basis.

    For a target with free rotation about that axis. Base frame; ``axis`` has length 1.
    """
    for a in range(3):
        basis[2, a] = (target_rotation[a, 0] * axis[0] + target_rotation[a, 1] * axis[1]
                       + target_rotation[a, 2] * axis[2])
    # The coordinate axis that is least along it is never parallel to it.
    k = 0
    for a in range(1, 3):
        if abs(basis[2, a]) < abs(basis[2, k]):
            k = a
    across = math.sqrt(1.0 - basis[2, k] ** 2)
    for a in range(3):
        basis[0, a] = ((1.0 if a == k else 0.0) - basis[2, k] * basis[2, a]) / across
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        basis[1, a] = basis[2, b] * basis[0, c] - basis[2, c] * basis[0, b]


@compiled
def fill_error(rotation: np.ndarray, position: np.ndarray, target_rotation: np.ndarray, target_position: np.ndarray,
               rows: int, basis: np.ndarray, error: np.ndarray) -> None:
    """Pose error: translation [m], then the rotation vector [rad] that turns the tip into the target; base frame.

    With a free turn the rotation is the smallest that turns the tip's free axis into the target's; it has no part along
    that axis, so that its components along the first two rows of ``basis`` describe it completely.
    """
    for a in range(3):
        error[a] = target_position[a] - position[a]
    t, r = target_rotation, rotation
    if rows == Rows.FREE_TURN:
        # The tip's present axis, in the base frame; then its components along the rows of the basis.
        x = t[0, 0] * basis[2, 0] + t[1, 0] * basis[2, 1] + t[2, 0] * basis[2, 2]
        y = t[0, 1] * basis[2, 0] + t[1, 1] * basis[2, 1] + t[2, 1] * basis[2, 2]
        z = t[0, 2] * basis[2, 0] + t[1, 2] * basis[2, 1] + t[2, 2] * basis[2, 2]
        x, y, z = (r[0, 0] * x + r[0, 1] * y + r[0, 2] * z, r[1, 0] * x + r[1, 1] * y + r[1, 2] * z,
                   r[2, 0] * x + r[2, 1] * y + r[2, 2] * z)
        x, y, z = (basis[0, 0] * x + basis[0, 1] * y + basis[0, 2] * z,
                   basis[1, 0] * x + basis[1, 1] * y + basis[1, 2] * z,
                   basis[2, 0] * x + basis[2, 1] * y + basis[2, 2] * z)
        sine = math.sqrt(x * x + y * y)
        scale = math.atan2(sine, z) / sine if sine > 1e-9 else 1.0
        error[3], error[4], error[5] = scale * y, -scale * x, 0.0
        if sine <= 1e-9 and z < 0.0:
            error[3], error[4] = math.pi, 0.0
        return
    # The turn from the tip to the target, its antisymmetric part and its diagonal.
    x = 0.5 * (t[2, 0] * r[1, 0] + t[2, 1] * r[1, 1] + t[2, 2] * r[1, 2]
               - t[1, 0] * r[2, 0] - t[1, 1] * r[2, 1] - t[1, 2] * r[2, 2])
    y = 0.5 * (t[0, 0] * r[2, 0] + t[0, 1] * r[2, 1] + t[0, 2] * r[2, 2]
               - t[2, 0] * r[0, 0] - t[2, 1] * r[0, 1] - t[2, 2] * r[0, 2])
    z = 0.5 * (t[1, 0] * r[0, 0] + t[1, 1] * r[0, 1] + t[1, 2] * r[0, 2]
               - t[0, 0] * r[1, 0] - t[0, 1] * r[1, 1] - t[0, 2] * r[1, 2])
    xx = t[0, 0] * r[0, 0] + t[0, 1] * r[0, 1] + t[0, 2] * r[0, 2]
    yy = t[1, 0] * r[1, 0] + t[1, 1] * r[1, 1] + t[1, 2] * r[1, 2]
    zz = t[2, 0] * r[2, 0] + t[2, 1] * r[2, 1] + t[2, 2] * r[2, 2]
    sine, cosine = math.sqrt(x * x + y * y + z * z), 0.5 * (xx + yy + zz - 1.0)
    if sine > 1e-6:
        scale = math.atan2(sine, cosine) / sine
        error[3], error[4], error[5] = scale * x, scale * y, scale * z
    elif cosine > 0.0:
        error[3], error[4], error[5] = x, y, z
    else:
        # Half a turn: the antisymmetric part vanishes, the axis is the largest column of the turn + 1.
        k = 0 if xx >= yy and xx >= zz else 1 if yy >= zz else 2
        for a in range(3):
            error[3 + a] = t[a, 0] * r[k, 0] + t[a, 1] * r[k, 1] + t[a, 2] * r[k, 2]
        error[3 + k] += 1.0
        scale = math.atan2(sine, cosine) / length(error, 3, 6)
        for a in range(3, 6):
            error[a] *= scale


@compiled
def on_target(error: np.ndarray, rows: int, tolerance_m: float, tolerance_rad: float) -> bool:
    """Return whether a pose error is within the tolerances."""
    return length(error, 0, 3) <= tolerance_m and (rows == Rows.POSITION or length(error, 3, rows) <= tolerance_rad)


@compiled
def within(error: np.ndarray, rows: int, bound: float) -> bool:
    """Return whether every component of a pose error is less than ``bound`` [m] and [rad]."""
    for row in range(rows):
        if not abs(error[row]) < bound:
            return False
    return True


@compiled
def workspace(n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return arrays for a posture's joint lines (n, 6), tip rotation (3, 3), position (3,), jacobian (6, n) and error
    (6,).
    """
    return np.empty((n, 6)), np.empty((3, 3)), np.empty(3), np.empty((6, n)), np.empty(6)


@compiled
def fill_task_jacobian(prismatic: np.ndarray, lines: np.ndarray, position: np.ndarray, rows: int, basis: np.ndarray,
                       jacobian: np.ndarray) -> None:
    """:func:`fill_jacobian`, its angular rows along ``basis`` where a turn is free."""
    fill_jacobian(prismatic, lines, position, jacobian)
    if rows == Rows.FREE_TURN:
        for i in range(jacobian.shape[1]):
            x, y, z = jacobian[3, i], jacobian[4, i], jacobian[5, i]
            for a in range(3):
                jacobian[3 + a, i] = basis[a, 0] * x + basis[a, 1] * y + basis[a, 2] * z


@compiled
def pose_error(arm: Arm, target: TargetArrays, q: np.ndarray) -> tuple[float, float]:
    """Return the pose error of the posture ``q``: [m], [rad]."""
    rotations, offsets, prismatic = arm
    target_rotation, target_position, rows, basis = target
    lines, rotation, position, _, error = workspace(q.shape[0])
    place_joints(rotations, offsets, prismatic, q, lines, rotation, position)
    fill_error(rotation, position, target_rotation, target_position, rows, basis, error)
    return length(error, 0, 3), length(error, 3, 6)


@compiled
def beyond_reach(target_rotation: np.ndarray, target_position: np.ndarray, shoulder: np.ndarray, tip_reach_m: float,
                 wrist_in_tip: np.ndarray, wrist_reach_m: float) -> tuple[float, float]:
    """Return how far the tip, and the wrist in this orientation, would be outside the balls around the shoulder [m]."""
    tip, wrist = 0.0, 0.0
    for a in range(3):
        from_shoulder = target_position[a] - shoulder[a]
        tip += from_shoulder * from_shoulder
        for b in range(3):
            from_shoulder -= target_rotation[a, b] * wrist_in_tip[b]
        wrist += from_shoulder * from_shoulder
    return math.sqrt(tip) - tip_reach_m, math.sqrt(wrist) - wrist_reach_m
