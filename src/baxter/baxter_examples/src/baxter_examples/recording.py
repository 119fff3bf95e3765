# SPDX-License-Identifier: BSD-3-Clause
"""Joint angles and gripper positions over time, in a CSV file. Free of ROS.

The first line names the columns: time [s], then for each side its joints [rad] and its gripper [%].
"""
from __future__ import annotations

import bisect
import csv
import io
import math
from typing import TYPE_CHECKING, Any, TextIO

from baxter_interface.joint_checks import limb_joint_names
from baxter_model import SIDES
from command_line.options import counted
from command_line.user_files import PIPE_WAIT_S, read_text

if TYPE_CHECKING:
    from pathlib import Path

#: An hour of both arms at 100 Hz has a quarter of it.
MAX_BYTES = 200_000_000
COLUMNS = ["time", *(name for side in SIDES for name in (*limb_joint_names(side), side + "_gripper"))]


class BadRecording(ValueError):
    """The file is not a valid recording; the text says where and why."""


class Recording:
    """Rows of values over time.

    Attributes: names: of the columns but time; times_s: rising; rows: dicts of name to value, one for each time.
    """

    def __init__(self, names: list[str], times_s: list[float], rows: list[dict[str, float]]) -> None:
        self.names, self.times_s, self.rows = names, times_s, rows

    @property
    def duration_s(self) -> float:
        """The last row's time [s]."""
        return self.times_s[-1]

    def side(self, side: str) -> tuple[list[str], bool]:
        """Split off one side: (names of its joints, whether it has a gripper)."""
        joints = [name for name in self.names if name in limb_joint_names(side)]
        return joints, side + "_gripper" in self.names

    def at(self, time_s: float) -> dict[str, float]:
        """Return the values at `time_s`, interpolated linearly between the rows; beyond the ends, those of the end
        rows."""
        after = bisect.bisect_right(self.times_s, time_s)
        if after == 0:
            return dict(self.rows[0])
        if after == len(self.times_s):
            return dict(self.rows[-1])
        begin_s, end_s = self.times_s[after - 1:after + 1]
        share = (time_s - begin_s) / (end_s - begin_s)
        before, behind = self.rows[after - 1:after + 1]
        return {name: before[name] + share * (behind[name] - before[name]) for name in self.names}


def write_row(stream: TextIO, values: list[Any]) -> None:
    """Write one row of the file: the column names, or numbers."""
    csv.writer(stream, lineterminator="\n").writerow(
        ["%.6f" % value if isinstance(value, float) else value for value in values])


def read(path: str | Path) -> Recording:
    """Read a recording. Raises BadRecording, OSError."""
    try:
        text = read_text(path, MAX_BYTES, pipe_wait_s=PIPE_WAIT_S)
    except UnicodeDecodeError as error:
        raise BadRecording("%s is no text: %s" % (path, error)) from None
    return parse(io.StringIO(text, newline=""), path)


def parse(stream: TextIO, path: str | Path) -> Recording:
    """The recording in a stream of lines; ``path`` names it in errors. Raises BadRecording."""
    try:
        lines = list(csv.reader(stream))
    except csv.Error as error:
        raise BadRecording("%s is no text of columns: %s" % (path, error)) from None
    if not lines or lines[0][:1] != ["time"]:
        raise BadRecording("%s: the first line must name the columns: time,left_s0,... as joint_recorder.py writes it"
                           % path)
    names = [name.strip() for name in lines[0][1:]]
    unknown = [name for name in names if name not in COLUMNS]
    if unknown or len(set(names)) < len(names) or not names:
        raise BadRecording("%s: the columns are time and any of %s, each once; found %s"
                           % (path, ", ".join(COLUMNS[1:]), ", ".join(unknown or names) or "none"))
    times_s, rows = [], []
    for number, line in enumerate(lines[1:], 2):
        try:
            time_s, *values = (float(value) for value in line)
            row = dict(zip(names, values, strict=True))
        except ValueError:
            raise BadRecording("%s, line %d: expected %s, got %r"
                               % (path, number, counted(len(names) + 1, "number"), ",".join(line))) from None
        if not all(map(math.isfinite, (time_s, *values))):
            raise BadRecording("%s, line %d: every number must be finite" % (path, number))
        if times_s and time_s <= times_s[-1]:
            raise BadRecording("%s, line %d: time %g does not come after %g" % (path, number, time_s, times_s[-1]))
        times_s.append(time_s)
        rows.append(row)
    if not rows:
        raise BadRecording("%s: there are no rows below the first line" % path)
    return Recording(names, times_s, rows)
