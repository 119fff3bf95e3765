# SPDX-License-Identifier: BSD-3-Clause
"""Commands to arms and their motions, row by row; CSV files of it."""
from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np

from baxter_model import SIDES, joint_names

from .arm_body import Array
from .errors import SysidError

#: A replay begins with the arm's own speed if it moves faster than this [rad/s].
MOVING = 0.05
COUNT_RAD = 0.000383495  # a count of the robot's position sensors
_AHEAD_ROWS = 9


class Recording(NamedTuple):
    """time_s (rows,), in equal steps; commanded, sensed: {side: (rows, 7) [rad]}, s0 to w2."""

    time_s: Array
    commanded: dict[str, Array]
    sensed: dict[str, Array]

    @property
    def period_s(self) -> float:
        return float(np.median(np.diff(self.time_s)))

    @classmethod
    def read(cls, path: str | Path) -> Recording:
        """Read a CSV file with the columns time_s, left_s0_commanded_rad, left_s0_sensed_rad ... of one arm or both.

        Raises SysidError where it cannot be used.
        """
        try:
            table = cast("Any", np.genfromtxt(path, delimiter=",", names=True))  # with names of columns
        except (OSError, ValueError) as error:
            raise SysidError("%s cannot be read: %s" % (path, error)) from error
        found: tuple[dict[str, Array], dict[str, Array]] = ({}, {})
        names = table.dtype.names or ()
        for side in SIDES:
            for kind, arms in zip(("commanded", "sensed"), found, strict=True):
                columns = ["%s_%s_rad" % (name, kind) for name in joint_names(side)]
                missing = [column for column in columns if column not in names]
                if not missing:
                    arms[side] = np.stack([table[column] for column in columns], axis=-1)
                elif len(missing) < len(columns):
                    raise SysidError("%s has no column %s" % (path, ", ".join(missing)))
        recording = cls(np.atleast_1d(table["time_s"]) if "time_s" in names else np.zeros(0), *found)
        recording.check(path)
        return recording

    def check(self, name: object) -> None:
        """Raises SysidError unless there are rows of finite numbers in equal steps of whole ticks."""
        if not self.commanded or set(self.commanded) != set(self.sensed):
            raise SysidError("%s must have commanded and sensed positions of the seven joints of an arm" % name)
        if len(self.time_s) < 2 * _AHEAD_ROWS:
            raise SysidError("%s has %d rows with a time; it must have %d or more" % (
                name, len(self.time_s), 2 * _AHEAD_ROWS))
        steps = np.diff(self.time_s)
        if not (np.isfinite(steps).all() and np.abs(steps - steps[0]).max() < 0.2 * abs(steps[0]) and steps[0] > 0.0):
            raise SysidError("%s: the times must rise in equal steps; they rise by %g to %g s" % (
                name, steps.min(), steps.max()))
        for side, rows in (*self.commanded.items(), *self.sensed.items()):
            if not np.isfinite(rows).all():
                raise SysidError("%s has positions of the %s arm that are no finite numbers" % (name, side))

    def write(self, path: str | Path) -> None:
        """Write the CSV file that `read` reads."""
        names, columns = ["time_s"], [self.time_s]
        for side in self.commanded:
            for kind, rows in (("commanded", self.commanded[side]), ("sensed", self.sensed[side])):
                names += ["%s_%s_rad" % (name, kind) for name in joint_names(side)]
                columns += list(rows.T)
        np.savetxt(path, np.stack(columns, axis=1), "%.6f", ",", header=",".join(names), comments="")


def start_of(sensed: Array, period_s: float) -> tuple[Array, Array]:
    """Position (n,) [rad] and velocity (n,) [rad/s] at the first row: of the line nearest to the first rows for joints
    that move there, so that a recording may begin in motion."""
    time_s = period_s * np.arange(_AHEAD_ROWS)
    curve = np.polynomial.polynomial.polyfit(time_s, sensed[:_AHEAD_ROWS], 2)
    moves = np.abs(curve[1]) > MOVING
    return np.where(moves, curve[0], sensed[0]), np.where(moves, curve[1], 0.0)
