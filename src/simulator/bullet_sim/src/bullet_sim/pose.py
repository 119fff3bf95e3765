# SPDX-License-Identifier: BSD-3-Clause
"""Position and orientation of a body."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from urdf_model import bounds
from urdf_model.transforms import matrix_from_quaternion, quaternion_from_matrix, rigid

from .errors import BulletSimError, within

# A larger norm is not a rounding of a unit quaternion, and its square may overflow.
_LONGEST_QUATERNION = 1e6


class Pose(NamedTuple):
    """A pose in the world: position [m] and unit quaternion (x, y, z, w)."""

    position: tuple = (0.0, 0.0, 0.0)
    quaternion: tuple = (0.0, 0.0, 0.0, 1.0)

    @classmethod
    def from_matrix(cls, matrix: np.ndarray) -> Pose:
        """Return the pose of a (4, 4) rigid transform."""
        return cls(tuple(matrix[:3, 3].tolist()), tuple(quaternion_from_matrix(matrix).tolist()))

    def matrix(self) -> np.ndarray:
        """Return the (4, 4) rigid transform of this pose. Raises ValueError for a quaternion without direction."""
        return rigid(matrix_from_quaternion(self.quaternion), np.asarray(self.position, dtype=float))

    def checked(self) -> Pose:
        """Return this pose with a normalised quaternion; raises BulletSimError when it is not a pose in this world."""
        if len(self.position) != 3 or len(self.quaternion) != 4:
            raise BulletSimError("a pose is 3 numbers of position and 4 of quaternion, found %s" % (self,))
        if not all(math.isfinite(v) for v in (*self.position, *self.quaternion)):
            raise BulletSimError("pose %s is not finite" % (self,))
        within(bounds.POSITION, self.position, "the position")
        norm = math.sqrt(sum(v * v for v in self.quaternion))
        if norm > _LONGEST_QUATERNION:
            raise BulletSimError("quaternion %s has a norm of %g; expected 1" % (list(self.quaternion), norm))
        if norm < 1e-6:
            # The default quaternion of a message is all zeros; Gazebo takes that as "no rotation", and so do we.
            return Pose(tuple(self.position), (0.0, 0.0, 0.0, 1.0))
        return Pose(tuple(map(float, self.position)), tuple(v / norm for v in self.quaternion))
