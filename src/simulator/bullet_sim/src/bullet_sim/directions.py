# SPDX-License-Identifier: BSD-3-Clause
"""Friction with different coefficients along a direction and across it (Gazebo's fdir1, mu and mu2).

Bullet scales the friction of a body along the axes of its inertial frame. So these are turned to the direction where
the moments of inertia leave that open, as those of wheels do.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from urdf_model import Surface

if TYPE_CHECKING:
    from collections.abc import Sequence

# Moments whose difference is at most this part of them are the same, and directions closer than this [rad].
_SAME, _CLOSE = 1e-3, 1e-2


class Directed(NamedTuple):
    """Coefficients of friction along the direction and across it, and the direction (3,), in the body's frame; None for
    those of the world (:mod:`.world_directions`)."""

    along: float
    across: float
    direction: tuple | None


def directed(surface: Surface | None, most: float) -> Directed | None:
    """Return the Directed of a surface with coefficients up to ``most``; None where all directions are the same."""
    if surface is None:
        return None
    mu = 1.0 if surface.friction is None else surface.friction
    along, across = min(mu, most), min(mu if surface.friction_across is None else surface.friction_across, most)
    return None if along == across else Directed(along, across, surface.direction)


def turned(moments: np.ndarray, axes: np.ndarray, direction: Sequence[float]) -> tuple[np.ndarray, np.ndarray, float]:
    """Return (moments (3,), axes (3, 3), [rad]) of an inertia, with an axis as near as possible to ``direction`` (3,),
    and the angle between them."""
    wanted = np.asarray(direction, dtype=float)
    if np.ptp(moments) <= _SAME * moments.max():
        first = np.cross(wanted, np.eye(3)[np.abs(wanted).argmin()])
        first /= np.linalg.norm(first)
        return moments, np.stack([wanted, first, np.cross(wanted, first)], axis=1), 0.0
    near = np.abs(axes.T @ wanted)
    for third in range(3):
        one, other = (third + 1) % 3, (third + 2) % 3
        spread = abs(moments[one] - moments[other])
        if spread <= _SAME * max(moments[one], moments[other]) and near[third] < math.sin(_CLOSE):
            first = wanted - axes[:, third] * (axes[:, third] @ wanted)
            first /= np.linalg.norm(first)
            found = axes.copy()
            found[:, one], found[:, other] = first, np.cross(axes[:, third], first)
            return moments, found, 0.0
    return moments, axes, math.acos(min(1.0, float(near.max())))


def scales(found: Directed, axes: np.ndarray) -> tuple[float, list[float]]:
    """Return (coefficient, scales of it along the three ``axes`` (3, 3)) for changeDynamics, of a Directed; those
    of one with the world's directions are all the same."""
    most = max(found.along, found.across)
    if found.direction is None:
        return most, [1.0] * 3
    factors = [found.across / most] * 3
    factors[int(np.abs(axes.T @ found.direction).argmax())] = found.along / most
    return most, factors


def is_off(angle: float) -> bool:
    """Whether an angle [rad] between a direction and its axis matters."""
    return angle > _CLOSE
