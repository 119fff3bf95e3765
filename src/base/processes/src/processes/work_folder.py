# SPDX-License-Identifier: BSD-3-Clause
"""Temporary folders that do not stay for ever where their process is killed. Free of ROS; Linux only."""
from __future__ import annotations

import contextlib
import fcntl
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

_LOCK = "lock"


@contextlib.contextmanager
def claimed_folder(prefix: str, end_users: Callable[[Path], object] = lambda folder: None) -> Iterator[Path]:
    """A new temporary folder (Path), which is removed at the end.

    Before, those of the same prefix whose processes were killed are removed: each running one holds a lock in its own.
    prefix: begins their names, such as "lab-check-". end_users: called with the path (Path) of each that is about to be
    removed, to end what uses it. Raises OSError.
    """
    top = Path(tempfile.gettempdir())
    for old in top.glob(prefix + "*"):
        _remove_if_left(old, end_users)
    # Under a hidden name until it is locked: else another start could remove it as a left one.
    folder = Path(tempfile.mkdtemp(prefix="." + prefix))
    try:
        with open(folder / _LOCK, "wb") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            folder = folder.rename(top / folder.name[1:])
            yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


@contextlib.contextmanager
def work_folder(prefix: str) -> Iterator[Path]:
    """A :func:`claimed_folder` that is TMPDIR until the end."""
    before = os.environ.get("TMPDIR")
    with claimed_folder(prefix) as folder:
        try:
            os.environ["TMPDIR"] = str(folder)
            tempfile.tempdir = None
            yield folder
        finally:
            os.environ.pop("TMPDIR", None)
            if before is not None:
                os.environ["TMPDIR"] = before
            tempfile.tempdir = None


def _remove_if_left(folder: Path, end_users: Callable[[Path], object]) -> None:
    with contextlib.suppress(OSError):
        if folder.is_symlink() or folder.stat().st_uid != os.getuid():
            return
        with open(folder / _LOCK, "rb") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            end_users(folder)
            shutil.rmtree(folder, ignore_errors=True)
