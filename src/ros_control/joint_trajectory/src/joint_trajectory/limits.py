# SPDX-License-Identifier: BSD-3-Clause
"""Position and velocity limits of joints."""
from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

from .errors import BeyondPosition, BeyondVelocity
from .trajectory import Trajectory

# Samples between two points that are checked against the limits: shares of the time between them.
_PLACES = np.linspace(0.0, 1.0, 9)


class Limits:
    """Bounds of n joints: ``lower``, ``upper`` (n,) [rad or m], ``velocity`` (n,) [per s]; inf where there is none.

    ``slack`` [rad or m] is the tolerance beyond a position limit, and the lag that a joint may have if a segment is too
    fast for it. Recorded positions need some: joints rest slightly beyond their limits, and readings that are played
    back at another rate have steps.
    """

    def __init__(self, joint_names: Iterable[str], lower: npt.ArrayLike, upper: npt.ArrayLike, velocity: npt.ArrayLike,
                 slack: float = 0.0) -> None:
        self._joint_names = list(joint_names)
        self._lower, self._upper = np.asarray(lower, dtype=float), np.asarray(upper, dtype=float)
        self._velocity = np.asarray(velocity, dtype=float)
        self._slack = slack

    def check(self, trajectory: Trajectory, begin_s: float, zero_s: float) -> None:
        """Check a :class:`Trajectory` from ``begin_s`` [s] on; times in errors are relative to ``zero_s`` [s].

        A joint that starts beyond its limit may stay there, but not go farther. Raises :class:`BeyondPosition`,
        :class:`BeyondVelocity`.
        """
        first = max(int(np.searchsorted(trajectory.starts, begin_s, side="right")) - 1, 0)
        begins = np.maximum(trajectory.starts[first:-1], begin_s)
        duration = trajectory.starts[first + 1:] - begins
        # Piece, sample, joint.
        s = (begins - trajectory.starts[first:-1])[:, None] + duration[:, None] * _PLACES
        position = np.einsum("mpi,mik->mpk", s[:, :, None] ** np.arange(6), trajectory.coefficients[first:-1])
        if not len(position):
            return
        lower = np.minimum(self._lower, position[0, 0]) - self._slack
        upper = np.maximum(self._upper, position[0, 0]) + self._slack
        beyond = np.argwhere((position < lower) | (position > upper))
        if len(beyond):
            piece, _, joint = beyond[0]
            excess = np.maximum(position[piece] - upper, lower - position[piece])[:, joint]
            place = int(np.argmax(excess))
            value = float(position[piece, place, joint])
            bound = self._lower if value < self._lower[joint] else self._upper
            raise BeyondPosition(self._joint_names[joint], value, float(bound[joint]),
                                 float(begins[piece] + duration[piece] * _PLACES[place] - zero_s))
        distance = np.abs(position[:, -1] - position[:, 0])
        fast = np.argwhere(distance > self._velocity * duration[:, None] + self._slack)
        if len(fast):
            piece, joint = fast[0]
            raise BeyondVelocity(self._joint_names[joint], float(distance[piece, joint] / duration[piece]),
                                 float(self._velocity[joint]), float(begins[piece] - zero_s))
