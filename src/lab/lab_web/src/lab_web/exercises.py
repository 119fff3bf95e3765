# SPDX-License-Identifier: BSD-3-Clause
"""The result of an exercise for pages, from the file that ``./baxter.sh check`` writes. No ROS."""
from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path
    from typing import Any

_LARGEST_BYTES = 1 << 20


class ExerciseResults:
    """``path``: the file. What is there at first belongs to an earlier lab and is not shown."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._seen = self._version()

    def newest(self) -> dict[str, Any] | None:
        """The result that has come since the last call, as pages show it, or None."""
        version = self._version()
        if version == self._seen:
            return None
        self._seen = version
        try:
            if self._path.stat().st_size > _LARGEST_BYTES:
                return None
            return shown_of(self._path.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None

    def _version(self) -> tuple[int, int, int] | None:
        try:
            found = self._path.stat()
        except OSError:
            return None
        return found.st_mtime_ns, found.st_ino, found.st_size


def shown_of(text: str) -> dict[str, Any]:
    """A result's JSON text as pages show it: ``exercise``, ``passed``, ``points`` (None: not graded), ``due``,
    ``why`` (of what is not graded), ``hint``, ``runs`` [{call, criteria [{name, points, of, found}]}]. All
    numbers are finite. Raises ValueError.
    """
    try:
        result = json.loads(text)
        return {"exercise": str(result["exercise"]), "passed": result["passed"] is True,
                "points": None if result["points"] is None else _number(result["points"]),
                "due": _number(result["pass_mark"]), "why": str(result["not_graded"] or ""),
                "hint": str(result["hint"] or ""),
                "runs": [{"call": " ".join(map(str, run["arguments"])),
                          "criteria": [{"name": str(one["name"]), "points": _number(one["points"]),
                                        "of": _number(one["of"]), "found": str(one["found"])}
                                       for one in run["criteria"]]} for run in result["runs"]]}
    except (KeyError, TypeError, OverflowError) as error:
        raise ValueError("no result of an exercise: %s" % error) from None


def _number(value: Any) -> float:
    """A finite number. JSON as Python reads it has NaN, and 1e999 is infinity: no browser reads either."""
    number = float(value)
    if not math.isfinite(number):
        raise ValueError("%s is no number of points" % value)
    return number
