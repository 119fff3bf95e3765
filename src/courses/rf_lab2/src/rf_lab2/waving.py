# SPDX-License-Identifier: BSD-3-Clause
"""Waving: a pose held up, and a sine on top of it. Free of ROS."""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from baxter_model import arm_angles

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

# The left arm with its hand up [rad].
HANDS_UP = {"s0": -0.3, "s1": -1.2, "e0": 0.0, "e1": 1.2, "w0": 0.0, "w1": -1.4, "w2": 0.0}
# The swing grows and fades within this [s].
RAMP_S = 1.0


def hands_up(side: str) -> dict[str, float]:
    """Joint angles {name: rad} of the arm `side`, "left" or "right", with its hand up."""
    return arm_angles(side, HANDS_UP)


def shifts(side: str, amplitude_m: float, count: int) -> np.ndarray:
    """Shifts (count, 3) [m, in base] of the gripper along one period: a sine along y, mirrored for the other arm."""
    phases = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    out = np.zeros((count, 3))
    out[:, 1] = (1.0 if side == "left" else -1.0) * amplitude_m * np.sin(phases)
    return out


class Swing:
    """Joint angles along a closed path, as a function of time."""

    def __init__(self, rows: ArrayLike, period_s: float) -> None:
        """`rows`: (n, joints) angles [rad] at even times within `period_s` [s]; the first one is the start.

        Raises ValueError for invalid rows or an invalid period.
        """
        rows = np.asarray(rows, dtype=float)
        if rows.ndim != 2 or len(rows) < 2 or not np.isfinite(rows).all() or not 0.0 < period_s < np.inf:
            raise ValueError("a swing needs two or more rows of finite angles and a period above 0 s; got an array of "
                             "shape %s and %s s" % (rows.shape, period_s))
        self._rows, self._period_s = rows, period_s
        self._places = np.arange(len(rows) + 1)
        self._columns = np.vstack([rows, rows[:1]]).T

    def angles(self, elapsed_s: float, total_s: float) -> np.ndarray:
        """Angles (joints,) [rad] after `elapsed_s` of `total_s`: at rest in the first row at both ends."""
        place = (elapsed_s / self._period_s * len(self._rows)) % len(self._rows)
        there = np.array([np.interp(place, self._places, column) for column in self._columns])
        part = min(1.0, max(0.0, min(elapsed_s, total_s - elapsed_s) / RAMP_S))
        return self._rows[0] + part**2 * (3.0 - 2.0 * part) * (there - self._rows[0])
