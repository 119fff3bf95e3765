# SPDX-License-Identifier: BSD-3-Clause
"""Results of students' own checks of their programs: read from their folders, kept for the instructor's page.

A check runs in the student's lab and writes its result there, so nothing here is proof, and nothing there is trusted:
the file may be a link, a pipe, or of any size.
"""
from __future__ import annotations

import contextlib
import json
import os
import stat
from typing import TYPE_CHECKING, Any

from lab_web.exercises import shown_of

if TYPE_CHECKING:
    from pathlib import Path

#: The result's file below a student's home (lab_web.page_files, where ROS_HOME is ~/.ros).
RESULT = (".ros", "lab_page", "exercise.json")
_KEPT = "verdicts.json"
_LARGEST_BYTES = 1 << 20
# Exercises of one student that are kept, and letters of an exercise's name.
_MOST, _LONGEST = 40, 60
#: Most points of a check.
POINTS = 100.0


class Verdicts:
    """Those of one student. ``folder``: of the lab, which the student does not see [Path]; ``home``: the student's."""

    def __init__(self, folder: Path, home: Path) -> None:
        self._file, self._home = folder / _KEPT, home
        self._seen = None
        #: {exercise: {"points": or None where it was not graded, "passed"}}, the last one of each.
        self.known = self._kept()

    def look(self) -> None:
        """Read a result that has come since the last call."""
        with contextlib.suppress(OSError, ValueError, RecursionError):
            version, text = _read(self._home, self._seen)
            if text is None:
                return
            self._seen = version
            result = shown_of(text)
            name = "".join(sign for sign in result["exercise"][:_LONGEST] if sign.isprintable())
            if not name or len(self.known) >= _MOST and name not in self.known:
                return
            self.known[name] = {"points": _points(result["points"]), "passed": result["passed"]}
            draft = self._file.with_suffix(".new")
            draft.write_text(json.dumps(self.known), encoding="utf-8")
            draft.replace(self._file)

    def _kept(self) -> dict[str, dict[str, Any]]:
        with contextlib.suppress(OSError, ValueError, KeyError, TypeError, AttributeError):
            kept = json.loads(self._file.read_text(encoding="utf-8"))
            return {name: {"points": _points(one["points"]), "passed": bool(one["passed"])}
                    for name, one in kept.items()}
        return {}


def _points(value: Any) -> float | None:
    """Points as a check gives them, or None for what is not graded. Raises ValueError, TypeError."""
    if value is not None and not 0.0 <= value <= POINTS:
        raise ValueError("%r are no points of a check" % value)
    return value


def _read(home: Path, seen: tuple[int, int, int] | None) -> tuple[tuple[int, int, int], str | None]:
    """(version, text) of the result's file; the text is None where the version is the one that was seen.

    No link is followed. Raises OSError, ValueError.
    """
    flags = os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
    with contextlib.ExitStack() as opened:
        here = os.open(home, flags | os.O_DIRECTORY)
        opened.callback(os.close, here)
        for name in RESULT:
            here = os.open(name, flags | (os.O_DIRECTORY if name != RESULT[-1] else 0), dir_fd=here)
            opened.callback(os.close, here)
        found = os.fstat(here)
        version = found.st_mtime_ns, found.st_ino, found.st_size
        if version == seen:
            return version, None
        if not stat.S_ISREG(found.st_mode) or found.st_size > _LARGEST_BYTES:
            raise ValueError("this is no result of a check")
        return version, os.read(here, _LARGEST_BYTES).decode("utf-8")
