# SPDX-License-Identifier: BSD-3-Clause
"""How a moving arm comes to rest within its joints' effort limits, and how far it moves until then.

All joints of an arm slow down in step, on a straight line in joint space: with a = -k v. That takes the torques
h - k M v, with M the arm's inertia, v its joints' velocities and h the torques of gravity and velocity. The largest k
within all joints' limits is the hardest stop; it ends after 1 / k, and each joint travels v / (2 k).
"""

from __future__ import annotations

import numpy as np

# Share of the joints' torques that a stop uses: the rest is for changes on the way, and for following.
SHARE = 0.9


def hardest_stop(velocity: np.ndarray, inertia: np.ndarray, bias: np.ndarray, limit: np.ndarray) -> np.ndarray:
    """Decelerations (n,) [rad/s^2], not negative, with which joints at velocity (n,) [rad/s] stop together.

    inertia: (n, n) [kg m^2]; bias: (n,) [Nm] that keeps the joints at these velocities; limit: (n,) [Nm] effort limits.
    Zero if the limits leave no torque to slow down.
    """
    momentum = inertia @ velocity
    moves = np.abs(momentum) > 1e-9
    if not moves.any():
        return np.zeros_like(velocity)
    left = SHARE * limit + np.sign(momentum) * bias
    rate = max(float((left[moves] / np.abs(momentum[moves])).min()), 0.0)
    return rate * np.abs(velocity)


def travel(velocity: np.ndarray, deceleration: np.ndarray) -> np.ndarray:
    """Stopping distances (n,) [rad] of joints at velocity (n,) [rad/s] with deceleration (n,) [rad/s^2]."""
    return velocity * velocity / (2.0 * np.maximum(deceleration, 1e-12))
