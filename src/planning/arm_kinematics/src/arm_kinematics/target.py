# SPDX-License-Identifier: BSD-3-Clause
"""The target of the tip: a pose, or the part of one that counts."""
from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from arm_kinematics import kernels
from arm_kinematics.errors import InvalidTarget
from urdf_model.transforms import matrix_from_quaternion, rigid

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from arm_kinematics.kernels import Rows

# A rotation with a smaller error counts as rounded and is normalised (the labs' quaternion has an error of 9e-4).
ROUNDED = 1e-2
# Weight of a radian of rotation in metres, to compare poses: about the length of a forearm.
METRES_PER_RADIAN = 0.3
# Unused basis of a target without a free axis.
_NO_AXIS = np.eye(3)


def pose_from_quaternion(position: Iterable[float], quaternion_xyzw: Iterable[float]) -> np.ndarray:
    """Return the pose (4, 4) at ``position`` (x, y, z) [m] with orientation (x, y, z, w).

    A quaternion whose length differs from 1 by less than 0.01 is normalised. Raises InvalidTarget for any other length
    and for numbers that are not finite.
    """
    try:
        x, y, z = position
        numbers = [float(number) for number in (x, y, z, *quaternion_xyzw)]
    except (TypeError, ValueError, OverflowError):
        numbers = []
    if len(numbers) != 7 or not all(map(math.isfinite, numbers)):
        raise InvalidTarget("position and orientation must be seven finite numbers, got position %s and quaternion "
                            "(x y z w) %s" % (position, quaternion_xyzw), (position, quaternion_xyzw))
    length = math.sqrt(sum(number * number for number in numbers[3:]))
    if abs(length - 1.0) > ROUNDED:
        hint = "; the identity is 0 0 0 1" if length == 0.0 else ""
        raise InvalidTarget("quaternion (x y z w) %s has length %.6g, a rotation needs length 1%s"
                            % (numbers[3:], length, hint), numbers)
    return rigid(matrix_from_quaternion(numbers[3:]), numbers[:3])


class Target:
    """A pose (4, 4) of the tip in the base frame, checked, and which of its components count.

    rotation (3, 3), orthonormal; position (3,) [m]; rows: which :class:`~arm_kinematics.kernels.Rows` of the
    pose error count; arrays: rotation, position, rows, basis, as the kernels take them.
    """

    def __init__(self, pose: ArrayLike, position_only: bool = False, free_axis: ArrayLike | None = None) -> None:
        """``position_only``: the orientation is free. ``free_axis`` (3,): the rotation about this axis of the tip, in
        the tip's frame, is free, e.g. (0, 0, 1) for a gripper that may come from any side.

        Raises InvalidTarget for an invalid pose, ValueError for an axis without direction.
        """
        try:
            matrix = np.array(pose, dtype=np.float64)
        except (TypeError, ValueError):
            matrix = np.empty(0)
        if matrix.shape != (4, 4):
            raise InvalidTarget("the target must be a 4 x 4 pose matrix, got %r" % (pose,), pose)
        self.rotation, self.position, basis = np.empty((3, 3)), np.empty(3), _NO_AXIS
        if not kernels.split_pose(matrix, ROUNDED, self.rotation, self.position):
            raise InvalidTarget("the target must hold a finite position, a rotation, and 0 0 0 1 in its last row, "
                                "got\n%s" % matrix, pose)
        self.rows = rows_of(position_only, free_axis)
        if free_axis is not None:
            basis = np.empty((3, 3))
            kernels.fill_basis(self.rotation, _direction(free_axis), basis)
        self.arrays = self.rotation, self.position, self.rows.value, basis

    @classmethod
    def of(cls, target: Target | ArrayLike) -> Target:
        """Return ``target``, a Target or a full pose (4, 4), as a Target."""
        return target if isinstance(target, Target) else cls(target)

    @property
    def pose(self) -> np.ndarray:
        """The requested pose as a new (4, 4), made orthonormal."""
        return rigid(self.rotation, self.position)


class Targets:
    """Many poses (m, 4, 4), each as a :class:`Target`, checked together.

    arrays: rotations (m, 3, 3), positions (m, 3) [m], rows, bases (m, 3, 3), as the kernels take them.
    """

    def __init__(self, poses: ArrayLike, position_only: bool = False, free_axis: ArrayLike | None = None) -> None:
        """Raises InvalidTarget with the number of an invalid pose, and ValueError as Target does."""
        try:
            matrices = np.array(poses, dtype=np.float64)
        except (TypeError, ValueError):
            raise InvalidTarget("the targets must be an array (m, 4, 4) of numbers, got %r" % (poses,), poses) from None
        if matrices.shape == (0,):
            matrices = np.empty((0, 4, 4))
        if matrices.ndim != 3 or matrices.shape[1:] != (4, 4):
            raise InvalidTarget("the targets must be an array (m, 4, 4), got one of shape %s" % (matrices.shape,),
                                poses)
        count = len(matrices)
        rotations, positions, bases = np.empty((count, 3, 3)), np.empty((count, 3)), np.empty((count, 3, 3))
        axis = None if free_axis is None else _direction(free_axis)
        for k in range(count):
            if not kernels.split_pose(matrices[k], ROUNDED, rotations[k], positions[k]):
                raise InvalidTarget("target %d must hold a finite position, a rotation, and 0 0 0 1 in its last row, "
                                    "got\n%s" % (k, matrices[k]), matrices[k])
            if axis is not None:
                kernels.fill_basis(rotations[k], axis, bases[k])
        self.arrays = rotations, positions, rows_of(position_only, free_axis).value, bases

    @classmethod
    def of(cls, targets: Targets | ArrayLike) -> Targets:
        """Return ``targets``, Targets or full poses (m, 4, 4), as Targets."""
        return targets if isinstance(targets, Targets) else cls(targets)

    def __len__(self) -> int:
        return len(self.arrays[1])


def rows_of(position_only: bool, free_axis: ArrayLike | None) -> Rows:
    """Return the Rows of the pose error that count; position_only overrides free_axis."""
    if position_only:
        return kernels.Rows.POSITION
    return kernels.Rows.POSE if free_axis is None else kernels.Rows.FREE_TURN


def _direction(axis: ArrayLike) -> np.ndarray:
    try:
        vector = np.array(axis, dtype=np.float64)
    except (TypeError, ValueError):
        vector = np.empty(0)
    length = float(np.linalg.norm(vector)) if vector.shape == (3,) else 0.0
    if not math.isfinite(length) or length < 1e-9:
        raise ValueError("the free axis must be a direction of three numbers, e.g. (0, 0, 1), got %r" % (axis,))
    return vector / length
