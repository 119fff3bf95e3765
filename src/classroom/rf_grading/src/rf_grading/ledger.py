# SPDX-License-Identifier: BSD-3-Clause
"""The verdicts of a grading as JSON lines, one for each key. Free of ROS.

A line counts when it is whole: what a crash has cut off is dropped, and judged again.
"""
from __future__ import annotations

import fcntl
import json
import os
from pathlib import Path
from typing import Any


class LedgerError(Exception):
    """The file is no ledger, or another grading writes to it."""


class Ledger:
    """verdicts: {key: verdict}, the newest of each key. A context manager. Raises LedgerError, OSError."""

    def __init__(self, path: Path) -> None:
        self._path = Path(path)
        flags = os.O_RDWR | os.O_CREAT | os.O_APPEND | os.O_NOFOLLOW | os.O_CLOEXEC
        self._stream = os.fdopen(os.open(self._path, flags, 0o644), "r+b")
        try:
            fcntl.flock(self._stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            self._stream.close()
            raise LedgerError("another grading is writing to %s; wait for it, or name another folder with --out"
                              % self._path.parent) from None
        try:
            self.verdicts = self._read()
        except BaseException:
            self._stream.close()
            raise

    def __enter__(self) -> Ledger:
        return self

    def __exit__(self, *_: Any) -> None:
        self._stream.close()

    def _read(self) -> dict[str, dict[str, Any]]:
        data = self._stream.read()
        whole = data.rfind(b"\n") + 1
        found = {}
        for number, line in enumerate(data[:whole].splitlines(), 1):
            try:
                row = json.loads(line)
                found[row["key"]] = row["verdict"]
            except (ValueError, KeyError, TypeError) as error:
                raise LedgerError("line %d of %s is no verdict (%s); name another folder with --out, or remove the "
                                  "file" % (number, self._path, error)) from error
        if whole < len(data):
            self._stream.truncate(whole)
        return found

    def add(self, key: str, verdict: dict[str, Any]) -> None:
        """Write one verdict (a dict that JSON can hold), and keep it."""
        line = json.dumps({"key": key, "verdict": verdict}, allow_nan=False).encode() + b"\n"
        self._stream.write(line)
        self._stream.flush()
        self.verdicts[key] = verdict
