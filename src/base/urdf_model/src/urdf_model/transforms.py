# SPDX-License-Identifier: BSD-3-Clause
"""Rigid transforms as 4x4 homogeneous matrices, in the conventions of URDF and of ROS messages.

A matrix ``T_a_b`` maps coordinates in frame b to coordinates in frame a. Quaternions are x, y, z, w. Roll, pitch
and yaw are rotations about the fixed axes x, y, z, applied in this order (URDF specification, ``origin`` element).
"""
from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
import numpy.typing as npt


def rpy_matrix(roll: float, pitch: float, yaw: float) -> np.ndarray:
    """Return the (3, 3) rotation of fixed-axis roll, pitch, yaw [rad]: Rz(yaw) Ry(pitch) Rx(roll)."""
    sr, cr = math.sin(roll), math.cos(roll)
    sp, cp = math.sin(pitch), math.cos(pitch)
    sy, cy = math.sin(yaw), math.cos(yaw)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def rpy_from_matrix(matrix: np.ndarray) -> tuple[float, float, float]:
    """Return fixed-axis roll, pitch, yaw [rad] of a rotation; where pitch is a right angle, roll is taken as zero."""
    level = math.hypot(matrix[0, 0], matrix[1, 0])
    pitch = math.atan2(-matrix[2, 0], level)
    if level < 1e-9:
        return 0.0, pitch, math.atan2(-matrix[0, 1], matrix[1, 1])
    return math.atan2(matrix[2, 1], matrix[2, 2]), pitch, math.atan2(matrix[1, 0], matrix[0, 0])


def pose_matrix(xyz: npt.ArrayLike = (0.0, 0.0, 0.0), rpy: Iterable[float] = (0.0, 0.0, 0.0)) -> np.ndarray:
    """Return the (4, 4) matrix of a URDF ``origin``: translation [m] and fixed-axis roll, pitch, yaw [rad]."""
    return rigid(rpy_matrix(*rpy), xyz)


def rigid(rotation: npt.ArrayLike, translation: npt.ArrayLike) -> np.ndarray:
    """Return the (4, 4) matrix of a (3, 3) rotation and a translation [m]."""
    matrix = np.eye(4)
    matrix[:3, :3] = rotation
    matrix[:3, 3] = translation
    return matrix


def inverse(matrix: np.ndarray) -> np.ndarray:
    """Return the inverse of a (4, 4) rigid transform, using that its rotation is orthogonal."""
    rotation = matrix[:3, :3].T
    return rigid(rotation, -rotation @ matrix[:3, 3])


def axis_rotation(axis: Iterable[float], angle: float) -> np.ndarray:
    """Return the (3, 3) rotation by ``angle`` [rad] about the unit vector ``axis`` (Rodrigues' formula)."""
    x, y, z = axis
    s, c = math.sin(angle), math.cos(angle)
    t = 1.0 - c
    return np.array(
        [
            [t * x * x + c, t * x * y - s * z, t * x * z + s * y],
            [t * x * y + s * z, t * y * y + c, t * y * z - s * x],
            [t * x * z - s * y, t * y * z + s * x, t * z * z + c],
        ]
    )


def quaternion_from_matrix(rotation: npt.ArrayLike) -> np.ndarray:
    """Return the unit quaternion (x, y, z, w), w >= 0, of a rotation given as (3, 3) or as (4, 4) transform.

    The largest of the four components is computed first (Shepperd 1978), so the result is accurate at all angles.
    """
    m = np.asarray(rotation, dtype=float)
    trace = m[0, 0] + m[1, 1] + m[2, 2]
    candidates = (m[0, 0], m[1, 1], m[2, 2], trace)
    largest = max(range(4), key=lambda i: candidates[i])
    q = np.empty(4)
    if largest == 3:
        q[3] = 1.0 + trace
        q[0] = m[2, 1] - m[1, 2]
        q[1] = m[0, 2] - m[2, 0]
        q[2] = m[1, 0] - m[0, 1]
    else:
        i = largest
        j, k = (i + 1) % 3, (i + 2) % 3
        q[i] = 1.0 + m[i, i] - m[j, j] - m[k, k]
        q[j] = m[j, i] + m[i, j]
        q[k] = m[k, i] + m[i, k]
        q[3] = m[k, j] - m[j, k]
    q /= math.sqrt(q @ q)
    return -q if q[3] < 0.0 else q


def matrix_from_quaternion(quaternion: npt.ArrayLike) -> np.ndarray:
    """Return the (3, 3) rotation of a quaternion (x, y, z, w); it is normalised first.

    Raises ValueError when it has no direction (zero or not finite).
    """
    q = np.asarray(quaternion, dtype=float)
    norm = math.sqrt(q @ q)
    if not math.isfinite(norm) or norm < 1e-9:
        raise ValueError("quaternion %s is not a rotation: its norm is %g, expected 1" % (list(q), norm))
    x, y, z, w = q / norm
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def rotation_angle(rotation: np.ndarray) -> float:
    """Return the angle [rad], 0 to pi, of a (3, 3) rotation; accurate for small angles too."""
    v = (rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1])
    return math.atan2(math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]), np.trace(rotation) - 1.0)
