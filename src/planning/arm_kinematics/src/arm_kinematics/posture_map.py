# SPDX-License-Identifier: BSD-3-Clause
"""A table of well-chosen postures as seeds of inverse kinematics: it returns the one whose tip is nearest the
target."""
from __future__ import annotations

import functools
import math
from collections.abc import Container, Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from arm_kinematics.target import METRES_PER_RADIAN

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from arm_kinematics.chain import Chain


class PostureMap:
    """Null-space set points of one chain. ``postures``: (m, n) joint values; their tip poses follow from the chain."""

    def __init__(self, chain: Chain, postures: Sequence[ArrayLike]) -> None:
        """Raises InvalidPosture for values that do not fit the chain, ValueError for an empty table."""
        if not len(postures):
            raise ValueError("a posture map needs at least one posture")
        self._postures = [np.clip(chain.posture(posture), chain.lower, chain.upper) for posture in postures]
        self._chain = chain

    @functools.cached_property
    def _tips(self) -> list[np.ndarray]:
        return [self._chain.fk(posture) for posture in self._postures]

    def nearest(self, target: np.ndarray) -> np.ndarray:
        """Return a copy of the posture (n,) whose tip is nearest the pose ``target`` (4, 4), tip in base."""
        return self._postures[min(range(len(self._tips)), key=lambda i: _separation(self._tips[i], target))].copy()


def mirrored(values: Iterable[float], joint_names: Iterable[str], turned_over: Container[str]) -> list[float]:
    """Return joint values for the arm on the other side: the joints in ``turned_over`` change their sign."""
    return [-value if name in turned_over else value for name, value in zip(joint_names, values, strict=True)]


def _separation(a: np.ndarray, b: np.ndarray) -> float:
    """Distance [m] between two poses, including a weighted rotation."""
    cosine = 0.5 * (float(np.tensordot(a[:3, :3], b[:3, :3])) - 1.0)
    angle = math.acos(min(max(cosine, -1.0), 1.0))
    return math.hypot(float(np.linalg.norm(a[:3, 3] - b[:3, 3])), METRES_PER_RADIAN * angle)
