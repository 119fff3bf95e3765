# SPDX-License-Identifier: BSD-3-Clause
"""What can go wrong in this package, each error with the values that it is about."""
import enum


class KinematicsError(Exception):
    """Root of every error that this package raises on purpose."""


class ChainError(KinematicsError):
    """The links between base and tip do not make a chain that can be computed."""


class InvalidTarget(KinematicsError):
    """The pose asked for is not a pose. ``value`` is what was given."""

    def __init__(self, message, value):
        super().__init__(message)
        self.value = value


class InvalidPosture(KinematicsError):
    """Joint values that do not fit the chain: wrong number, wrong names, or not finite. ``value`` is what was given."""

    def __init__(self, message, value):
        super().__init__(message)
        self.value = value


class Reason(enum.Enum):
    """Why a pose has no solution."""

    OUT_OF_REACH = "out of reach"
    JOINT_LIMIT = "joint limit"
    NOT_CONVERGED = "not converged"


class NoSolution(KinematicsError):
    """Inverse kinematics found no posture for ``target``.

    target: the (4, 4) pose asked for, tip in base [m].
    reason: a :class:`Reason`; joints: names of the joints whose limits are in the way (only for JOINT_LIMIT).
    detail: one sentence that says what was found and what would help.
    residual_m, residual_rad: how far from the target the best attempt inside the limits stayed; best: its joint values.
    """

    def __init__(self, target, reason, detail, residual_m, residual_rad, best, joints=()):
        super().__init__("%s: %s (nearest attempt: %.4f m and %.4f rad away)"
                         % (reason.value, detail, residual_m, residual_rad))
        self.target = target
        self.reason = reason
        self.detail = detail
        self.residual_m = residual_m
        self.residual_rad = residual_rad
        self.best = best
        self.joints = tuple(joints)
