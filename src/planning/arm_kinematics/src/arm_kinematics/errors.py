# SPDX-License-Identifier: BSD-3-Clause
"""The errors of this package, each with the values that it concerns."""
from __future__ import annotations

import enum
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import numpy as np


class KinematicsError(Exception):
    """Base class of this package's errors. All of them can be pickled."""

    def __reduce__(self) -> tuple[Callable[..., KinematicsError], tuple[object, ...]]:
        # By default, unpickling calls the class with the message alone, which fails, and a process pool then waits for
        # ever.
        return _restored, (type(self), self.args, self.__dict__)


class ChainError(KinematicsError):
    """The links between base and tip do not make a chain that can be computed."""


class InvalidTarget(KinematicsError):
    """The target is not a pose. ``value`` is the given one."""

    def __init__(self, message: str, value: object) -> None:
        super().__init__(message)
        self.value = value


class InvalidPosture(KinematicsError):
    """Joint values that do not fit the chain: wrong number, wrong names, or not finite. ``value`` is the given one."""

    def __init__(self, message: str, value: object) -> None:
        super().__init__(message)
        self.value = value


class InvalidSeed(KinematicsError):
    """A request has no usable seed; the text says what would be right."""


class Reason(enum.Enum):
    """Why a pose has no solution."""

    OUT_OF_REACH = "out of reach"
    JOINT_LIMIT = "joint limit"
    NOT_CONVERGED = "not converged"
    SELF_COLLISION = "self-collision"
    WORLD_COLLISION = "collision with the world"


class Attempt(NamedTuple):
    """Joint values q (n,), the tip's pose (4, 4) there, and its distance to the target."""

    q: np.ndarray
    pose: np.ndarray
    residual_m: float
    residual_rad: float


class NoSolution(KinematicsError):
    """Inverse kinematics found no posture for ``target``.

    target: the requested pose (4, 4), tip in base [m].
    reason: a :class:`Reason`.
    detail: one sentence that says what was found and what would help. best: joint values (n,) inside the limits with
    the tip nearest to the target; nearest: the tip's pose (4, 4) there; residual_m, residual_rad: its distance to the
    target, about 0 if a collision is the reason. joints: names of the joints whose limits prevent a solution, excess:
    how far each would have to exceed its limit [rad or m] (only for JOINT_LIMIT). pair: the two links that touch (only
    for collisions; a link of the world as "model/link").
    """

    def __init__(self, target: np.ndarray, reason: Reason, detail: str, attempt: Attempt, *, joints: Iterable[str] = (),
                 excess: Iterable[float] = (), pair: Iterable[str] = ()) -> None:
        """``attempt``: the best :class:`Attempt`."""
        super().__init__("%s: %s%s" % (reason.value, detail, _nearest_sentence(attempt)))
        self.target = target
        self.reason = reason
        self.detail = detail
        self.best, self.nearest, self.residual_m, self.residual_rad = attempt
        self.joints = tuple(joints)
        self.excess = tuple(excess)
        self.pair = tuple(pair)


def _restored(kind: type[KinematicsError], args: tuple[Any, ...], values: dict[str, Any]) -> KinematicsError:
    error = kind.__new__(kind, *args)
    error.__dict__.update(values)
    return error


def _nearest_sentence(attempt: Attempt) -> str:
    if attempt.residual_m < 1e-5 and attempt.residual_rad < 1e-5:
        return ""
    return " (the nearest pose in reach is at %.3f %.3f %.3f, %.4f m and %.4f rad away)" % (
        *attempt.pose[:3, 3], attempt.residual_m, attempt.residual_rad)
