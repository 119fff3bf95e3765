# SPDX-License-Identifier: BSD-3-Clause
"""Velocities and wrench of an arm's end point."""

from __future__ import annotations

import numpy as np

# Added to the diagonal of J J^T: keeps the wrench finite where the arm is singular and changes it by less than 1e-4
# of its value elsewhere (the smallest eigenvalue of J J^T is about 0.02 in common poses).
_DAMPING = 1e-6
# Damping of the inverse from twist to joint velocities: the tip loses 1 % of its speed where the least singular value
# of J is ten times this.
SINGULARITY_DAMPING = 0.02


def twist(jacobian: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    """(6,) linear [m/s] and angular [rad/s] velocity of the tip in base, from (6, k) Jacobian and (k,) joint speeds."""
    return jacobian @ velocity


def joint_velocities(jacobian: np.ndarray, tip_twist: np.ndarray) -> np.ndarray:
    """(k,) [rad/s] that move the tip at (6,) twist [m/s, rad/s], approximately near singularities, so that no joint
    gets too fast.

    Damped least squares: J^T (J J^T + d^2 I)^-1.
    """
    gram = jacobian @ jacobian.T
    gram.flat[::7] += SINGULARITY_DAMPING**2
    return jacobian.T @ np.linalg.solve(gram, tip_twist)


def contact_wrench(jacobian: np.ndarray, effort: np.ndarray, gravity: np.ndarray) -> np.ndarray:
    """(6,) external force [N] and torque [Nm] on the tip, in base, at the tip.

    jacobian: (6, k), linear rows first; effort: (k,) [Nm] what the drives apply; gravity: (k,) [Nm] what balances
    gravity. At rest the drives balance gravity and contact, effort = gravity - J^T w; least squares gives w.
    """
    gram = jacobian @ jacobian.T
    gram.flat[::7] += _DAMPING
    return np.linalg.solve(gram, jacobian @ (gravity - effort))
