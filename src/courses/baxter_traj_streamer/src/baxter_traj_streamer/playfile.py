# SPDX-License-Identifier: BSD-3-Clause
"""Joint-space playfiles (``.jsp``): per line the seven angles of an arm and an arrival time. Free of ROS."""
from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from command_line.options import counted
from command_line.user_files import PIPE_WAIT_S, read_text

from .errors import GoalRefused
from .judging import judge
from .settings import JOINTS, arm_joint_names
from .timing import arrival_times

if TYPE_CHECKING:
    from pathlib import Path

    from baxter_traj_streamer.settings import StreamerSettings

    from .judging import StreamedJointLimit

#: Of a playfile; the notes' have some kilobytes.
MAX_BYTES = 100_000_000
_COLUMNS = len(JOINTS) + 1


class PlayfileError(ValueError):
    """The playfile cannot be used; the text names file, line, what was found and what would be right."""


class Playfile(NamedTuple):
    """``positions`` (m, 7) [rad] and ``times`` (m,) [s], increasing, not below 0, of one arm; ``source``: its name;
    ``lines``: line number of each row in the source."""

    positions: np.ndarray
    times: np.ndarray
    source: str
    lines: tuple[int, ...]

    @classmethod
    def read(cls, path: Path) -> Playfile:
        """Read a file. Raises PlayfileError, OSError."""
        try:
            text = read_text(path, MAX_BYTES, pipe_wait_s=PIPE_WAIT_S)
        except UnicodeDecodeError as error:
            raise PlayfileError("%s is not a text: %s" % (path, error)) from error
        return cls.parse(text, str(path))

    @classmethod
    def parse(cls, text: str, source: str = "playfile") -> Playfile:
        """Take the content of a file; empty lines and text after a # are ignored. Raises PlayfileError."""
        rows, lines = [], []
        for number, line in enumerate(text.splitlines(), start=1):
            fields = line.partition("#")[0].strip().rstrip(",")
            if fields:
                rows.append(_numbers(fields.split(","), source, number))
                lines.append(number)
                if rows[-1][-1] < 0.0 or (len(rows) > 1 and rows[-1][-1] <= rows[-2][-1]):
                    raise PlayfileError("%s, line %d: the time %.9g s must be above %s" % (
                        source, number, rows[-1][-1],
                        "that of line %d, %.9g s" % (lines[-2], rows[-2][-1]) if len(rows) > 1 else "or at 0"))
        if not rows:
            raise PlayfileError("%s has no rows; each is %s, arrival time" % (source, ", ".join(JOINTS)))
        table = np.array(rows)
        return cls(table[:, :-1], table[:, -1], source, tuple(lines))

    def text(self) -> str:
        """The content of a file; times are rounded to the ms, angles to the microrad."""
        return "".join("%s, %.3f\n" % (", ".join("%.6f" % angle for angle in row), time)
                       for row, time in zip(self.positions, self.times, strict=True))

    def retimed(self, velocity: np.ndarray, min_segment_s: float) -> Playfile:
        """The same poses with the notes' arrival times for ``velocity`` (7,) [rad/s]."""
        return self._replace(times=np.array(arrival_times(self.positions, velocity, min_segment_s)))


def merged(playfiles: Mapping[str, Playfile]) -> tuple[list[str], np.ndarray, np.ndarray]:
    """(joint names, times (m,), positions (m, k)) of {side: Playfile}, each starting at its first row at time 0.

    It has a row for each time of any file; between its own rows an arm moves linearly, after them it rests.
    """
    times = np.unique(np.concatenate([file.times - file.times[0] for file in playfiles.values()]))
    names, columns = [], []
    for side, file in playfiles.items():
        names += arm_joint_names(side)
        columns += [np.interp(times, file.times - file.times[0], column) for column in file.positions.T]
    return names, times, np.array(columns).T


def check(playfiles: Mapping[str, Playfile], limits: Mapping[str, StreamedJointLimit],
          settings: StreamerSettings) -> None:
    """Check {side: Playfile} as the server would, but without the start; arguments as for judging.judge.

    Raises PlayfileError, which names the file and, if known, the line.
    """
    names, times, positions = merged(playfiles)
    if len(times) == 1:
        # A single pose: only the joints' limits are checked.
        times = times + 1.0
    try:
        judge(names, [(time, row, (), ()) for time, row in zip(times, positions, strict=True)], limits, None, settings)
    except GoalRefused as refusal:
        where = ", ".join(file.source for file in playfiles.values())
        if refusal.joint is not None and refusal.point is not None:
            file = playfiles[refusal.joint.partition("_")[0]]
            row = int(np.searchsorted(file.times - file.times[0], times[refusal.point]))
            where = "%s, line %d" % (file.source, file.lines[min(row, len(file.lines) - 1)])
        raise PlayfileError("%s: %s" % (where, refusal)) from refusal


def _numbers(fields: Sequence[str], source: str, line: int) -> list[float]:
    if len(fields) != _COLUMNS:
        raise PlayfileError("%s, line %d has %s, expected %d: %s, arrival time" % (
            source, line, counted(len(fields), "number"), _COLUMNS, ", ".join(JOINTS)))
    row = []
    for field, name in zip(fields, (*JOINTS, "arrival time"), strict=True):
        try:
            row.append(float(field))
        except ValueError:
            row.append(math.nan)
        if not math.isfinite(row[-1]):
            raise PlayfileError("%s, line %d: %s is %r, not a finite number" % (source, line, name, field.strip()))
    return row
