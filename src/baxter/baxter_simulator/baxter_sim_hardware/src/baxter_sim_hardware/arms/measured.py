# SPDX-License-Identifier: BSD-3-Clause
"""What is known of the arms' joints when a tick begins."""
import numpy as np


class Measured:
    """State of the arms' n joints. One object; each tick renews its values.

    time_s: [s]; position: (n,) [rad]; velocity: (n,) [rad/s]; gravity: (n,) [Nm] the torque that balances gravity.
    """

    __slots__ = ("time_s", "position", "velocity", "gravity")

    def __init__(self, position):
        """At rest in ``position`` at time 0."""
        self.time_s = 0.0
        self.position = np.array(position, dtype=float)
        self.velocity = np.zeros_like(self.position)
        self.gravity = np.zeros_like(self.position)
