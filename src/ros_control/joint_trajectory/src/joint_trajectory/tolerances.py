# SPDX-License-Identifier: BSD-3-Clause
"""Tolerances on the joints' errors, on the path and at the goal."""
from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from .segment import Floats

#: Joint name, position, velocity, acceleration.
Row = tuple[str, float, float, float]


class Tolerances(NamedTuple):
    """Bounds on position, velocity and acceleration error, arrays (3, n) [rad or m, per s, per s^2]; inf: no bound.

    ``path`` applies during the motion, ``goal`` at the end; ``goal_time_s`` is the allowed delay of the end [s].
    """

    path: Floats
    goal: Floats
    goal_time_s: float

    @classmethod
    def none(cls, count: int) -> Tolerances:
        """No bounds on ``count`` joints."""
        return cls(np.full((3, count), np.inf), np.full((3, count), np.inf), 0.0)


def bounds(count: int, position: npt.ArrayLike = 0.0, velocity: npt.ArrayLike = 0.0,
           acceleration: npt.ArrayLike = 0.0) -> Floats:
    """(3, n) for :class:`Tolerances` from numbers or arrays (n,) in which 0 stands for no bound."""
    table = np.empty((3, count))
    for row, values in enumerate((position, velocity, acceleration)):
        table[row] = values
    table[~(table > 0.0)] = np.inf
    return table


def merge_tolerances(defaults: Tolerances, joint_names: Sequence[str], path: Iterable[Row] = (),
                     goal: Iterable[Row] = (), goal_time_s: float = 0.0) -> Tolerances:
    """A new :class:`Tolerances`: ``defaults`` with a goal's own values.

    ``path`` and ``goal``: rows of (joint name, position, velocity, acceleration). A positive number replaces the
    default, a negative one removes the bound, 0 keeps the default; the same for ``goal_time_s`` [s], where a negative
    one means no time at all. Rows of other joints are ignored.
    """
    if goal_time_s == 0.0:
        goal_time_s = defaults.goal_time_s
    return Tolerances(_merged(defaults.path, joint_names, path), _merged(defaults.goal, joint_names, goal),
                      max(goal_time_s, 0.0))


def _merged(default: Floats, joint_names: Sequence[str], rows: Iterable[Row]) -> Floats:
    table = default.copy()
    for name, *values in rows:
        if name in joint_names:
            column = table[:, joint_names.index(name)]
            for row, value in enumerate(values):
                if value > 0.0:
                    column[row] = value
                elif value < 0.0:
                    column[row] = np.inf
    return table
