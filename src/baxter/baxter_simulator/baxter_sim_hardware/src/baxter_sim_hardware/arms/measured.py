# SPDX-License-Identifier: BSD-3-Clause
"""The measured state of the arms' joints at the start of a tick."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import ArrayLike


class Measured:
    """State of the arms' n joints. One object; each tick renews its values.

    time_s: [s]; missing_s: [s] the time at which a command that is missing now must have come, or None where none was
    read since the last tick; position: (n,) [rad]; velocity: (n,) [rad/s]; gravity: (n,) [Nm] the torque that balances
    gravity.
    dynamics: function (velocity (n,) [rad/s]) -> (inertia (n, n) [kg m^2], torque (n,) [Nm] that keeps the joints at
    that velocity), at the present position.
    """

    __slots__ = ("time_s", "missing_s", "position", "velocity", "gravity", "dynamics")

    def __init__(self, position: ArrayLike, dynamics: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]) -> None:
        """At rest in ``position`` at time 0."""
        self.dynamics = dynamics
        self.time_s = 0.0
        self.missing_s: float | None = 0.0
        self.position = np.array(position, dtype=float)
        self.velocity = np.zeros_like(self.position)
        self.gravity = np.zeros_like(self.position)
