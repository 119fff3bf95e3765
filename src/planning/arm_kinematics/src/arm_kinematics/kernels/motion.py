# SPDX-License-Identifier: BSD-3-Clause
"""Forward kinematics of joints and tip, and Jacobians."""
from __future__ import annotations

import math

import numpy as np

from arm_kinematics.kernels.compiled import compiled


@compiled
def place_joints(rotations: np.ndarray, offsets: np.ndarray, prismatic: np.ndarray, q: np.ndarray, lines: np.ndarray,
                 rotation: np.ndarray, position: np.ndarray) -> None:
    """Forward kinematics; fills the tip's ``rotation`` and ``position`` and the joints' ``lines`` (n, 6): the direction
    of each joint's axis, then a point on it, the joint's origin.
    """
    r00, r01, r02 = 1.0, 0.0, 0.0
    r10, r11, r12 = 0.0, 1.0, 0.0
    r20, r21, r22 = 0.0, 0.0, 1.0
    x, y, z = 0.0, 0.0, 0.0
    n = q.shape[0]
    for i in range(n + 1):
        ox, oy, oz = offsets[i, 0], offsets[i, 1], offsets[i, 2]
        x += r00 * ox + r01 * oy + r02 * oz
        y += r10 * ox + r11 * oy + r12 * oz
        z += r20 * ox + r21 * oy + r22 * oz
        c = rotations[i]
        a00 = r00 * c[0, 0] + r01 * c[1, 0] + r02 * c[2, 0]
        a01 = r00 * c[0, 1] + r01 * c[1, 1] + r02 * c[2, 1]
        a02 = r00 * c[0, 2] + r01 * c[1, 2] + r02 * c[2, 2]
        a10 = r10 * c[0, 0] + r11 * c[1, 0] + r12 * c[2, 0]
        a11 = r10 * c[0, 1] + r11 * c[1, 1] + r12 * c[2, 1]
        a12 = r10 * c[0, 2] + r11 * c[1, 2] + r12 * c[2, 2]
        a20 = r20 * c[0, 0] + r21 * c[1, 0] + r22 * c[2, 0]
        a21 = r20 * c[0, 1] + r21 * c[1, 1] + r22 * c[2, 1]
        a22 = r20 * c[0, 2] + r21 * c[1, 2] + r22 * c[2, 2]
        if i == n:
            rotation[0, 0], rotation[0, 1], rotation[0, 2] = a00, a01, a02
            rotation[1, 0], rotation[1, 1], rotation[1, 2] = a10, a11, a12
            rotation[2, 0], rotation[2, 1], rotation[2, 2] = a20, a21, a22
            position[0], position[1], position[2] = x, y, z
            return
        if prismatic[i]:
            x += a02 * q[i]
            y += a12 * q[i]
            z += a22 * q[i]
            r00, r01, r10, r11, r20, r21 = a00, a01, a10, a11, a20, a21
        else:
            cosine, sine = math.cos(q[i]), math.sin(q[i])
            r00, r01 = a00 * cosine + a01 * sine, a01 * cosine - a00 * sine
            r10, r11 = a10 * cosine + a11 * sine, a11 * cosine - a10 * sine
            r20, r21 = a20 * cosine + a21 * sine, a21 * cosine - a20 * sine
        r02, r12, r22 = a02, a12, a22
        lines[i, 0], lines[i, 1], lines[i, 2] = a02, a12, a22
        lines[i, 3], lines[i, 4], lines[i, 5] = x, y, z


@compiled
def fill_jacobian(prismatic: np.ndarray, lines: np.ndarray, position: np.ndarray, jacobian: np.ndarray) -> None:
    """Geometric Jacobian (6, n) of the point ``position``: linear rows first, base frame."""
    for i in range(lines.shape[0]):
        ax, ay, az = lines[i, 0], lines[i, 1], lines[i, 2]
        if prismatic[i]:
            jacobian[0, i], jacobian[1, i], jacobian[2, i] = ax, ay, az
            jacobian[3, i], jacobian[4, i], jacobian[5, i] = 0.0, 0.0, 0.0
        else:
            dx, dy, dz = position[0] - lines[i, 3], position[1] - lines[i, 4], position[2] - lines[i, 5]
            jacobian[0, i] = ay * dz - az * dy
            jacobian[1, i] = az * dx - ax * dz
            jacobian[2, i] = ax * dy - ay * dx
            jacobian[3, i], jacobian[4, i], jacobian[5, i] = ax, ay, az


@compiled
def joint_frames(rotations: np.ndarray, offsets: np.ndarray, prismatic: np.ndarray,
                 q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the rotations (n + 1, 3, 3) and origins (n + 1, 3) of every joint's moved frame, and of the tip (last)."""
    n = q.shape[0]
    all_rotations, all_origins = np.empty((n + 1, 3, 3)), np.empty((n + 1, 3))
    turn, point = np.eye(3), np.zeros(3)
    for i in range(n + 1):
        for a in range(3):
            point[a] += turn[a, 0] * offsets[i, 0] + turn[a, 1] * offsets[i, 1] + turn[a, 2] * offsets[i, 2]
        for a in range(3):
            for b in range(3):
                all_rotations[i, a, b] = (turn[a, 0] * rotations[i, 0, b] + turn[a, 1] * rotations[i, 1, b]
                                          + turn[a, 2] * rotations[i, 2, b])
        turn[:] = all_rotations[i]
        if i < n:
            if prismatic[i]:
                point += turn[:, 2] * q[i]
            else:
                cosine, sine = math.cos(q[i]), math.sin(q[i])
                for a in range(3):
                    u, v = turn[a, 0], turn[a, 1]
                    turn[a, 0], turn[a, 1] = u * cosine + v * sine, v * cosine - u * sine
        all_rotations[i] = turn
        all_origins[i] = point
    return all_rotations, all_origins


@compiled
def tip_and_jacobian(rotations: np.ndarray, offsets: np.ndarray, prismatic: np.ndarray,
                     q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the tip's pose (4, 4) in the base frame and its Jacobian (6, n)."""
    n = q.shape[0]
    lines, rotation, position = np.empty((n, 6)), np.empty((3, 3)), np.empty(3)
    pose, jacobian = np.zeros((4, 4)), np.empty((6, n))
    place_joints(rotations, offsets, prismatic, q, lines, rotation, position)
    fill_jacobian(prismatic, lines, position, jacobian)
    pose[:3, :3] = rotation
    pose[:3, 3] = position
    pose[3, 3] = 1.0
    return pose, jacobian
