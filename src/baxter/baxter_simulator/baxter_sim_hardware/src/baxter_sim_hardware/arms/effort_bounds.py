# SPDX-License-Identifier: BSD-3-Clause
"""How hard the joints' drives may push, and how far a set-point may lead its joint."""

from __future__ import annotations

import numpy as np

from .joint_modes import RAW_POSITION

# A set-point leads its joint by no more than this [rad]. At an error of that size the joint motors already use their
# full effort; a larger one would only cause overshoot. In free motion the joints stay within a tenth of it.
REACH_RAD = 1e-3
# An arm that touches the robot itself pushes with this share of its effort limits in position and velocity mode, in
# addition to the torque that carries its weight.
YIELD_FACTOR = 0.3


class EffortBounds:
    """limit: (n,) [Nm] the joints' effort limits, for the whole effort of a drive, including the part that carries the
    arm's weight.

    Attribute `balanced`: (n,) 1 where torque mode adds the torque that balances gravity, 0 where not.
    """

    def __init__(self, limit: np.ndarray) -> None:
        self._limit = limit
        self.balanced = np.ones(len(limit))
        self._yielding = np.zeros(len(limit), dtype=bool)
        self.any_yields = False

    def set_yielding(self, index: np.ndarray, yields: bool) -> None:
        """Whether joints `index`, in all modes but raw position, push with no more than YIELD_FACTOR of the limits."""
        self._yielding[index] = yields
        self.any_yields = bool(self._yielding.any())

    def bound(self, gravity: np.ndarray, mode: np.ndarray) -> np.ndarray:
        """(n,) [Nm] largest effort of the drives; gravity: (n,) [Nm] the part that carries the weight; mode: (n,)."""
        if not self.any_yields:
            return self._limit
        gentle = self._yielding & (mode != RAW_POSITION)
        return np.where(gentle, np.minimum(YIELD_FACTOR * self._limit + np.abs(gravity), self._limit), self._limit)
