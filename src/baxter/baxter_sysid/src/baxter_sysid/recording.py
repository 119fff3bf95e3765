# SPDX-License-Identifier: BSD-3-Clause
"""Commands to arms and their motions, row by row; CSV files of them."""
from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from baxter_model import SIDES, joint_names
from command_line.user_files import PIPE_WAIT_S, read_text
from urdf_model import Robot

from .arm_body import TICK_S, Array
from .errors import SysidError

#: Larger files and longer recordings would take hours.
MAX_BYTES, MAX_S = 100_000_000, 600.0
#: The largest step between two rows [s]: the robot takes raw set-points that come more slowly for single ones.
MAX_STEP_S = 0.05
#: So far beyond its limits [rad] a joint may be, so far may a command be, so far apart may the two be on the average.
BEYOND_RAD, COMMANDED_BEYOND_RAD, APART_RAD = 0.1, 0.5, 0.5
#: A recording shows nothing in which no joint is commanded to go farther than this [rad].
MIN_WAY_RAD = 0.02

#: A replay begins with the arm's own speed if it moves faster than this [rad/s].
MOVING = 0.05
COUNT_RAD = 0.000383495  # a count of the robot's position sensors
_AHEAD_ROWS = 9
_REST_S = 1.0
_CREEPING, _STILL_RAD = 0.005, 0.005  # [rad/s], [rad]: a joint at rest is not faster, and not farther from a line


class ArmRecording(NamedTuple):
    """time_s (rows,), in equal steps; commanded, sensed: {side: (rows, 7) [rad]}, s0 to w2."""

    time_s: Array
    commanded: dict[str, Array]
    sensed: dict[str, Array]

    @property
    def period_s(self) -> float:
        return float(np.median(np.diff(self.time_s)))

    @classmethod
    def read(cls, path: str | Path) -> ArmRecording:
        """Read a CSV file with the columns time_s, left_s0_commanded_rad, left_s0_sensed_rad ... of one arm or both;
        its rows are put into equal steps of whole ticks. Raises SysidError where it cannot be used.
        """
        try:
            lines = read_text(path, MAX_BYTES, pipe_wait_s=PIPE_WAIT_S).splitlines()
        except UnicodeDecodeError as error:
            raise SysidError("%s is no text, and must be a CSV file: %s" % (path, error)) from error
        except OSError as error:
            raise SysidError("%s cannot be read: %s" % (path, error.strerror or error)) from error
        names = [name.strip(' "') for name in (lines or [""])[0].lstrip("\ufeff# ").split(",")]
        columns = {side: {kind: ["%s_%s_rad" % (name, kind) for name in joint_names(side)]
                          for kind in ("commanded", "sensed")} for side in SIDES}
        _require_columns(path, names, columns)
        sides = [side for side in SIDES if columns[side]["sensed"][0] in names]
        used = ["time_s", *(column for side in sides for each in columns[side].values() for column in each)]
        table = dict(zip(used, _numbers(path, lines[1:], names, used).T, strict=True))
        arms = [{side: np.stack([table[column] for column in columns[side][kind]], axis=-1) for side in sides}
                for kind in ("commanded", "sensed")]
        recording = cls(table["time_s"], *arms)
        recording.check(path)
        return recording.in_ticks()

    def check(self, name: object) -> None:
        """Raises SysidError unless there are enough rows of finite numbers, whose times rise in small steps."""
        if len(self.time_s) < 2 * _AHEAD_ROWS:
            raise SysidError("%s has %d rows with a time; it must have %d or more" % (
                name, len(self.time_s), 2 * _AHEAD_ROWS))
        steps = np.diff(self.time_s)
        wrong = ~((steps > 0.0) & (steps < 1.001 * MAX_STEP_S))
        if wrong.any():
            row = int(np.argmax(wrong))
            raise SysidError("%s: after row %d time_s goes from %.10g to %.10g; times must rise by %g s or less from "
                             "row to row" % (name, row + 1, self.time_s[row], self.time_s[row + 1], MAX_STEP_S))
        if self.time_s[-1] - self.time_s[0] > MAX_S:
            raise SysidError("%s is %.0f s long; it must be %.0f s or less: a minute of motion is enough" % (
                name, self.time_s[-1] - self.time_s[0], MAX_S))
        for kind, arms in (("commanded", self.commanded), ("sensed", self.sensed)):
            for side, rows in arms.items():
                if not np.isfinite(rows).all():
                    row, joint = np.argwhere(~np.isfinite(rows))[0]
                    raise SysidError("%s: %s_%s_rad is %s at %g s; it must be a finite number" % (
                        name, joint_names(side)[joint], kind, rows[row, joint], self.time_s[row]))

    def require_motion(self, name: object, robot: Robot, sides: tuple[str, ...]) -> None:
        """Raises SysidError for arms `sides` that do not move, or are where joints of `robot` cannot be: it may be in
        degrees, or of another arm."""
        for side in sides:
            for joint, commanded, sensed in zip(joint_names(side), self.commanded[side].T, self.sensed[side].T,
                                                strict=True):
                limit = robot.joints[joint].limit
                for kind, rows, most in (("sensed", sensed, BEYOND_RAD), ("commanded", commanded,
                                                                          COMMANDED_BEYOND_RAD)):
                    beyond = np.maximum(limit.lower - rows, rows - limit.upper)
                    if beyond.max() > most:
                        row = int(np.argmax(beyond))
                        raise SysidError("%s: %s_%s_rad is %g at %g s; the joint goes from %g to %g rad. Are the "
                                         "positions in degrees, or another joint's?" % (
                                             name, joint, kind, rows[row], self.time_s[row], limit.lower, limit.upper))
                apart = float(np.mean(np.abs(commanded - sensed)))
                if apart > APART_RAD:
                    raise SysidError("%s: %s is %.2f rad from where it is commanded to be, on the average; %g rad or "
                                     "less would be right. Are the columns of the same joint, in rad?" % (
                                         name, joint, apart, APART_RAD))
            way = np.ptp(self.commanded[side], axis=0)
            if way.max() < MIN_WAY_RAD:
                raise SysidError("%s: no joint of the %s arm is commanded to go farther than %.2g rad; a motion shows "
                                 "its numbers if each joint that is fitted goes some 0.1 rad or more" % (
                                     name, side, way.max()))

    def in_ticks(self) -> ArmRecording:
        """The same in equal steps of whole ticks, as a replay needs it."""
        step = TICK_S * max(1, round(self.period_s / TICK_S))
        grid = self.time_s[0] + step * np.arange(1 + int((self.time_s[-1] - self.time_s[0]) / step + 0.01))
        if len(grid) == len(self.time_s) and np.abs(grid - self.time_s).max() < 0.1 * step:
            return self
        arms = [{side: np.stack([np.interp(grid, self.time_s, joint) for joint in rows.T], axis=1)
                 for side, rows in each.items()} for each in (self.commanded, self.sensed)]
        return ArmRecording(grid, *arms)

    def write(self, path: str | Path) -> None:
        """Write the CSV file that `read` reads."""
        names, columns = ["time_s"], [self.time_s]
        for side in self.commanded:
            for kind, rows in (("commanded", self.commanded[side]), ("sensed", self.sensed[side])):
                names += ["%s_%s_rad" % (name, kind) for name in joint_names(side)]
                columns += list(rows.T)
        np.savetxt(path, np.stack(columns, axis=1), "%.6f", ",", header=",".join(names), comments="")


def _require_columns(path: object, names: list[str], columns: dict[str, dict[str, list[str]]]) -> None:
    """Raises SysidError unless a file with columns `names` has a time, and all columns of an arm or both."""
    wanted = [["time_s"], *([*of["commanded"], *of["sensed"]] for of in columns.values())]
    if not any(set(of) & set(names) for of in wanted[1:]):
        if len(names) == 1 and any(mark in names[0] for mark in ";\t"):
            found = "its columns are parted by %r, and must be by commas" % next(m for m in ";\t" if m in names[0])
        else:
            found = "its first line is %.60r" % ",".join(names)
        raise SysidError("%s must have commanded and sensed positions of the seven joints of an arm, in columns such "
                         "as %s and %s; %s" % (path, wanted[1][0], wanted[1][7], found))
    for of in wanted:
        missing = [column for column in of if column not in names]
        if missing and (of[0] == "time_s" or len(missing) < len(of)):
            raise SysidError("%s has no column %s" % (path, ", ".join(missing)))
        twice = [column for column in of if names.count(column) > 1]
        if twice:
            raise SysidError("%s has more than one column %s" % (path, twice[0]))


def _numbers(path: object, lines: list[str], names: list[str], used: list[str]) -> Array:
    """(rows, k) columns `used` of lines of numbers, whose columns are `names`; lines without text do not count."""
    index = [names.index(column) for column in used]
    rows = [line for line in lines if line.strip()]
    try:
        return np.loadtxt(rows, delimiter=",", usecols=index, ndmin=2) if rows else np.zeros((0, len(used)))
    except ValueError as error:
        raise SysidError("%s: %s" % (path, _wrong_cell(lines, names, used) or error)) from error


def _wrong_cell(lines: list[str], names: list[str], used: list[str]) -> str:
    """Where the first line that is not made of numbers is, and what is wrong there."""
    for number, line in enumerate(lines, 2):
        cells = line.split(",")
        if line.strip() and len(cells) < len(names):
            return "line %d has %d columns, and the first line has %d" % (number, len(cells), len(names))
        for column in used if line.strip() else ():
            cell = cells[names.index(column)].strip()
            try:
                float(cell)
            except ValueError:
                return "line %d: %s is %r; it must be a number" % (number, column, cell[:30])
    return ""


def start_of(sensed: Array, period_s: float, commanded: Array | None = None) -> tuple[Array, Array]:
    """Position (n,) [rad] and velocity (n,) [rad/s] at the first row; sensed, commanded: (rows, n) [rad].

    Of joints that move there it is that of the line nearest to the first rows, so that a recording may begin in motion;
    of the others the first position, and no speed. If `commanded` is given, a joint that rests for a second or until it
    is commanded to move begins on the line nearest to that rest: noise in its start would be a torque that the robot
    never exerted, for as long as friction holds the joint, or a motion.
    """
    time_s = period_s * np.arange(len(sensed))
    curve = np.polynomial.polynomial.polyfit(time_s[:_AHEAD_ROWS], sensed[:_AHEAD_ROWS], 2)
    moves = np.abs(curve[1]) > MOVING
    position, velocity = np.where(moves, curve[0], sensed[0]), np.where(moves, curve[1], 0.0)
    for joint, wanted in enumerate(() if commanded is None else commanded.T):
        told = np.abs(wanted - wanted[0]) > COUNT_RAD
        rows = slice(min(int(np.argmax(told)) if told.any() else len(told), 1 + round(_REST_S / period_s)))
        if rows.stop > _AHEAD_ROWS:
            line = np.polynomial.polynomial.polyfit(time_s[rows], sensed[rows, joint], 1)
            off = sensed[rows, joint] - np.polynomial.polynomial.polyval(time_s[rows], line)
            if abs(line[1]) < _CREEPING and np.abs(off).max() < _STILL_RAD:
                position[joint], velocity[joint] = line[0], 0.0
    return position, velocity
