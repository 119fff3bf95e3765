# SPDX-License-Identifier: BSD-3-Clause
"""Results as JSON lines: a header with job, parameters and versions, then a line for each episode.

A file that exists is continued: seeds with a result are not run again, and a last line that a crash cut off is dropped.
Where versions have changed meanwhile, another header stands before the lines of the new ones.
"""
from __future__ import annotations

import fcntl
import json
import math
import os
import platform
import subprocess
import sys
from importlib import metadata
from pathlib import Path
from typing import Any

from .job import Outcome, Spec

PACKAGES = ("numpy", "pybullet", "numba", "ray")


class RecordsError(Exception):
    """A file is no file of results, or of another job."""


def versions(root: Path) -> dict[str, str]:
    """{name: version} of what results may depend on. root: a folder of the workspace, for its commit."""
    found = {"python": platform.python_version(), "machine": platform.machine()}
    for name in PACKAGES:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    done = subprocess.run(["git", "-C", str(root), "describe", "--always", "--dirty"], capture_output=True, text=True)
    if done.returncode == 0:
        found["workspace"] = done.stdout.strip()
    return found


def line_of(outcome: Outcome) -> str:
    row = {"seed": outcome.seed, "seconds": round(outcome.seconds, 6)}
    row.update({"error": outcome.error} if outcome.error else {"result": outcome.result})
    return json.dumps(row, allow_nan=False)


def _outcome(row: dict[str, Any]) -> Outcome:
    """The reverse of `line_of`. Raises KeyError, ValueError."""
    outcome = Outcome(row["seed"], row.get("result", {}), row.get("error", ""), row["seconds"])
    for name, kinds in (("seed", int), ("result", dict), ("error", str), ("seconds", (int, float))):
        value = getattr(outcome, name)
        if not isinstance(value, kinds) or isinstance(value, bool):
            raise ValueError("%s is %.60r in the line of seed %.60r" % (name, value, row["seed"]))
    return outcome


class Records:
    """The file of one batch, which no other batch can use meanwhile. Raises RecordsError, OSError.

    header: job, parameters and versions, as they stand in the file; "earlier versions" (a list) where some of its
    results are of others.
    """

    def __init__(self, path: Path, spec: Spec, found_versions: dict) -> None:
        self._path = path
        self.outcomes = {}  # {seed: the newest Outcome}
        self.header = header = {"job": spec.name, "parameters": spec.parameters, "versions": found_versions}
        if path.is_fifo():  # opening it would wait for a reader
            raise RecordsError("%s is a named pipe; name a file with --out" % path)
        path.parent.mkdir(parents=True, exist_ok=True)
        self._stream = path.open("a", encoding="utf-8")
        try:
            self._take_over(header)
        except BaseException:
            self._stream.close()
            raise

    def _take_over(self, header: dict[str, Any]) -> None:
        # Of devices, only /dev/null is of use; others may be read without end.
        there = []
        if self._path.is_file():
            try:
                fcntl.flock(self._stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise RecordsError("another batch is writing to %s; wait for its end, or name another file with --out"
                                   % self._path) from None
            there = self._read(header)
        if header["versions"] not in there[-1:]:
            self._write(json.dumps({"batch": header}))
        if earlier := [one for one in there if one != header["versions"]]:
            self.header = {**header, "earlier versions": earlier}

    def _read(self, header: dict[str, Any]) -> list[dict[str, str]]:
        """Take over what the file has; return the versions of its headers."""
        data = self._path.read_bytes()
        whole = data.rfind(b"\n") + 1
        lines = data[:whole].decode("utf-8", "replace").splitlines()
        rows, headers = [], []
        try:
            for line in lines:
                row = json.loads(line)
                (headers if "batch" in row else rows).append(row.get("batch", row))
            if lines and "batch" not in json.loads(lines[0]):
                raise ValueError("it does not begin with a header")
            versions_there = [one.get("versions") for one in headers]
            outcomes = [_outcome(row) for row in rows]
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
            raise RecordsError("%s is no file of results: %s; name another with --out" % (self._path, error)) from error
        for what in ("job", "parameters"):
            for there in headers:
                if there.get(what) != header[what]:
                    raise RecordsError("%s has results of %s %s, not %s; name another file with --out" % (
                        self._path, what, there.get(what), header[what]))
        self._truncate(whole)
        self.outcomes = {one.seed: one for one in outcomes}
        return versions_there

    def _truncate(self, size: int) -> None:
        if self._path.stat().st_size != size:
            os.truncate(self._path, size)

    def _write(self, line: str) -> None:
        self._stream.write(line + "\n")
        self._stream.flush()

    def add(self, outcome: Outcome) -> Outcome:
        """Write one outcome, whose result is as job.plain() returns it. Returns the outcome."""
        self._write(line_of(outcome))
        self.outcomes[outcome.seed] = outcome
        return outcome

    def close(self) -> None:
        self._stream.close()


def summary(outcomes: list[Outcome]) -> list[str]:
    """Lines about the results: the share of each truth value, mean, least and greatest of each number."""
    done = [one.result for one in outcomes if one.is_done]
    lines = []
    for name in dict.fromkeys(name for result in done for name in result):
        values = [result[name] for result in done if name in result]
        if all(isinstance(value, bool) for value in values):
            lines.append("%s: %d of %d" % (name, sum(values), len(values)))
        elif all(isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) <= sys.float_info.max
                 for value in values):
            lines.append("%s: mean %.6g, from %.6g to %.6g (%d)" % (
                name, math.fsum(values) / len(values), min(values), max(values), len(values)))
    return lines
