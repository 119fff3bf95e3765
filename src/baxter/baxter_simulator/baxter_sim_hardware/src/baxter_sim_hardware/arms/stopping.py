# SPDX-License-Identifier: BSD-3-Clause
"""How an arm that moves comes to rest within what its joints can exert, and how far it gets until then.

All joints of an arm slow down in step, on a straight line in joint space: with a = -k v. That takes the torques
h - k M v, with M the arm's inertia, v its joints' velocities and h what gravity and velocity ask for. The greatest k
that no joint's limit forbids is the hardest stop; it ends after 1 / k, and each joint travels v / (2 k).
"""
import numpy as np

# What a stop uses of the joints' torques: the rest is for what changes on the way, and for following.
SHARE = 0.9


def hardest_stop(velocity, inertia, bias, limit):
    """Decelerations (n,) [rad/s^2], not negative, with which joints at velocity (n,) [rad/s] stop together.

    inertia: (n, n) [kg m^2]; bias: (n,) [Nm] what keeps the joints at these velocities; limit: (n,) [Nm] that they may
    exert. Zero where the limits leave nothing to slow down with.
    """
    momentum = inertia @ velocity
    moves = np.abs(momentum) > 1e-9
    if not moves.any():
        return np.zeros_like(velocity)
    left = SHARE * limit + np.sign(momentum) * bias
    rate = max(float((left[moves] / np.abs(momentum[moves])).min()), 0.0)
    return rate * np.abs(velocity)


def travel(velocity, deceleration):
    """How far joints get (n,) [rad] that move at velocity (n,) [rad/s] and slow down by deceleration (n,) [rad/s^2]."""
    return velocity * velocity / (2.0 * np.maximum(deceleration, 1e-12))
