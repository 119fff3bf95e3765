# SPDX-License-Identifier: BSD-3-Clause
"""Results as JSON lines: a header with job, parameters and versions, then a line for each episode.

A file that exists is continued: seeds with a result are not run again, and a last line that a crash cut off is dropped.
"""
import json
import math
import os
import platform
import subprocess
from importlib import metadata
from pathlib import Path

from .job import Outcome, Spec

PACKAGES = ("numpy", "pybullet", "numba", "ray")


class RecordsError(Exception):
    """A file is no file of results, or of another job."""


def versions(root):
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


def line_of(outcome):
    row = {"seed": outcome.seed, "seconds": round(outcome.seconds, 6)}
    row.update({"error": outcome.error} if outcome.error else {"result": outcome.result})
    return json.dumps(row, allow_nan=False)


class Records:
    """The file of one batch. Raises RecordsError, OSError."""

    def __init__(self, path: Path, spec: Spec, found_versions: dict):
        self._path = path
        self.outcomes = {}  # {seed: the newest Outcome}
        self.header = header = {"job": spec.name, "parameters": spec.parameters, "versions": found_versions}
        # Of devices, only /dev/null is of use; others may be read without end.
        is_new = not path.is_file() or not self._read(header)
        path.parent.mkdir(parents=True, exist_ok=True)
        self._stream = path.open("a", encoding="utf-8")
        if is_new:
            self._write(json.dumps({"batch": header}))

    def _read(self, header):
        """Take over what the file has; return whether it has a header."""
        data = self._path.read_bytes()
        whole = data.rfind(b"\n") + 1
        lines = data[:whole].decode("utf-8", "replace").splitlines()
        if not lines:
            self._truncate(0)
            return False
        try:
            there = json.loads(lines[0])["batch"]
            rows = [json.loads(line) for line in lines[1:]]
            outcomes = [Outcome(row["seed"], row.get("result", {}), row.get("error", ""), row["seconds"])
                        for row in rows]
        except (ValueError, KeyError, TypeError) as error:
            raise RecordsError("%s is no file of results: %s; name another with --out" % (self._path, error)) from error
        for what in ("job", "parameters"):
            if there.get(what) != header[what]:
                raise RecordsError("%s has results of %s %s, not %s; name another file with --out" % (
                    self._path, what, there.get(what), header[what]))
        self._truncate(whole)
        self.outcomes = {one.seed: one for one in outcomes}
        return True

    def _truncate(self, size):
        if self._path.stat().st_size != size:
            os.truncate(self._path, size)

    def _write(self, line):
        self._stream.write(line + "\n")
        self._stream.flush()

    def add(self, outcome):
        """Write one outcome; a result that JSON cannot hold makes it a failed one. Returns what was written."""
        try:
            line = line_of(outcome)
        except (TypeError, ValueError) as error:
            outcome = Outcome(outcome.seed, {}, "its results cannot be written as JSON: %s" % error, outcome.seconds)
            line = line_of(outcome)
        self._write(line)
        self.outcomes[outcome.seed] = outcome
        return outcome

    def close(self):
        self._stream.close()


def summary(outcomes):
    """Lines about the results: the share of each truth value, mean, least and greatest of each number."""
    done = [one.result for one in outcomes if one.is_done]
    lines = []
    for name in dict.fromkeys(name for result in done for name in result):
        values = [result[name] for result in done if name in result]
        if all(isinstance(value, bool) for value in values):
            lines.append("%s: %d of %d" % (name, sum(values), len(values)))
        elif all(isinstance(value, (int, float)) and not isinstance(value, bool) for value in values):
            lines.append("%s: mean %.6g, from %.6g to %.6g (%d)" % (
                name, math.fsum(values) / len(values), min(values), max(values), len(values)))
    return lines
