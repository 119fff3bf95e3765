# SPDX-License-Identifier: BSD-3-Clause
"""Positions, quaternions and homogeneous matrices. Free of ROS.

Quaternions are x, y, z, w here, as in ROS. transforms3d has w first: only `rotation_matrix` and `quaternion` change the
order.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from transforms3d import axangles, quaternions

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


def unit_quaternion(quaternion_xyzw: ArrayLike) -> np.ndarray:
    """Scale a quaternion (4 numbers) to length 1. Raises ValueError if it is zero, not finite or not four numbers."""
    values = np.asarray(quaternion_xyzw, dtype=float)
    length = np.linalg.norm(values)
    if values.shape != (4,) or not math.isfinite(length) or length < 1e-9:
        raise ValueError("a quaternion is four finite numbers x, y, z, w, not all zero; got %s" % (quaternion_xyzw,))
    return values / length


def rotation_matrix(quaternion_xyzw: ArrayLike) -> np.ndarray:
    """Return the (3, 3) rotation matrix of a quaternion. Raises ValueError as unit_quaternion."""
    x, y, z, w = unit_quaternion(quaternion_xyzw)
    return quaternions.quat2mat((w, x, y, z))


def quaternion(rotation: np.ndarray) -> np.ndarray:
    """Return the unit quaternion x, y, z, w (with w ≥ 0) of a (3, 3) rotation matrix."""
    w, x, y, z = quaternions.mat2quat(rotation)
    return np.array((x, y, z, w))


def homogeneous_matrix(translation: ArrayLike, quaternion_xyzw: ArrayLike) -> np.ndarray:
    """Return the (4, 4) matrix that maps points of the moved frame to the frame it is given in.

    Parameters: `translation` x, y, z [m]; `quaternion_xyzw`. Raises ValueError as unit_quaternion.
    """
    matrix = np.eye(4)
    matrix[:3, :3] = rotation_matrix(quaternion_xyzw)
    matrix[:3, 3] = translation
    return matrix


def moved_pose(translation: ArrayLike, quaternion_xyzw: ArrayLike, axis: str = "x", angle_rad: float = 0.0,
               shift_m: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> tuple[np.ndarray, np.ndarray]:
    """Shift a pose along its own axes, then rotate it about one of them: "x", "y" or "z".

    Returns (translation [m], quaternion x, y, z, w) as arrays. Raises ValueError for another axis or a bad quaternion.
    """
    if axis not in AXES:
        raise ValueError("the axis is one of %s, not %r" % (", ".join(AXES), axis))
    step = np.eye(4)
    step[:3, :3] = axangles.axangle2mat(AXES[axis], angle_rad)
    step[:3, 3] = shift_m
    moved = homogeneous_matrix(translation, quaternion_xyzw) @ step
    return moved[:3, 3], quaternion(moved[:3, :3])


def pose_difference(translation_a: ArrayLike, quaternion_a_xyzw: ArrayLike, translation_b: tuple[float, float, float],
                    quaternion_b_xyzw: ArrayLike) -> tuple[float, float]:
    """Return the difference of two poses: (distance [m], angle [rad], 0 to pi)."""
    distance = float(np.linalg.norm(np.subtract(translation_a, translation_b)))
    a, b = unit_quaternion(quaternion_a_xyzw), unit_quaternion(quaternion_b_xyzw)
    # q and -q are the same rotation. The half-angle formula keeps its precision near zero, where arccos loses it.
    apart, opposite = np.linalg.norm(a - b), np.linalg.norm(a + b)
    return distance, 4.0 * math.atan2(min(apart, opposite), max(apart, opposite))
