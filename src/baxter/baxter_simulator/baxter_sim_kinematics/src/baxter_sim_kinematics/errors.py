# SPDX-License-Identifier: BSD-3-Clause
"""What can go wrong in this package, each error with the values that it is about."""
import enum
from typing import NamedTuple

import numpy as np


class KinematicsError(Exception):
    """Root of every error that this package raises on purpose. All of them can be sent between processes."""

    def __reduce__(self):
        # Exception would call the class with the message alone, and a pool waits for ever for what cannot be unpacked.
        return _restored, (type(self), self.args, self.__dict__)


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


class InvalidSeed(KinematicsError):
    """A request says nothing that a search could start from; the text says what would be right."""


class Reason(enum.Enum):
    """Why a pose has no solution."""

    OUT_OF_REACH = "out of reach"
    JOINT_LIMIT = "joint limit"
    NOT_CONVERGED = "not converged"
    SELF_COLLISION = "self-collision"
    WORLD_COLLISION = "collision with the world"


class Attempt(NamedTuple):
    """Joint values q (n,), the tip's pose (4, 4) there, and how far that is from the target."""

    q: np.ndarray
    pose: np.ndarray
    residual_m: float
    residual_rad: float


class NoSolution(KinematicsError):
    """Inverse kinematics found no posture for ``target``.

    target: the (4, 4) pose asked for, tip in base [m].
    reason: a :class:`Reason`.
    detail: one sentence that says what was found and what would help.
    best: joint values (n,) inside the limits that put the tip as near the target as was found; nearest: its pose (4, 4)
    there; residual_m, residual_rad: how far that is from the target. 0 in effect where a collision is the reason.
    joints: names of the joints whose limits are in the way, excess: by how much each would have to go beyond [rad or m]
    (only for JOINT_LIMIT).
    pair: the two links that touch (only for collisions; a link of the world as "model/link").
    """

    def __init__(self, target, reason, detail, attempt, *, joints=(), excess=(), pair=()):
        """``attempt``: the best :class:`Attempt`."""
        super().__init__("%s: %s%s" % (reason.value, detail, _nearest_sentence(attempt)))
        self.target = target
        self.reason = reason
        self.detail = detail
        self.best, self.nearest, self.residual_m, self.residual_rad = attempt
        self.joints = tuple(joints)
        self.excess = tuple(excess)
        self.pair = tuple(pair)


def _restored(kind, args, values):
    error = kind.__new__(kind, *args)
    error.__dict__.update(values)
    return error


def _nearest_sentence(attempt):
    if attempt.residual_m < 1e-5 and attempt.residual_rad < 1e-5:
        return ""
    return " (the nearest pose in reach is at %.3f %.3f %.3f, %.4f m and %.4f rad away)" % (
        *attempt.pose[:3, 3], attempt.residual_m, attempt.residual_rad)
