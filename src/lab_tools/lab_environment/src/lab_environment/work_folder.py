# SPDX-License-Identifier: BSD-3-Clause
"""A temporary folder that does not stay for ever where its process is killed. Free of ROS; Linux only."""
import contextlib
import fcntl
import os
import shutil
import tempfile
from pathlib import Path

_LOCK = "lock"


@contextlib.contextmanager
def work_folder(prefix):
    """A new folder (Path), which is TMPDIR until the end and is then removed.

    Before, those of the same prefix whose processes were killed are removed: each running one holds a lock in its own.
    prefix: begins their names, such as "lab-check-". Raises OSError.
    """
    top = Path(tempfile.gettempdir())
    for old in top.glob(prefix + "*"):
        _remove_if_left(old)
    # Under a hidden name until it is locked: else another start could remove it as a left one.
    hidden = Path(tempfile.mkdtemp(prefix="." + prefix))
    before = os.environ.get("TMPDIR")
    folder = hidden
    try:
        with open(hidden / _LOCK, "wb") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            folder = hidden.rename(top / hidden.name[1:])
            os.environ["TMPDIR"] = str(folder)
            tempfile.tempdir = None
            yield folder
    finally:
        os.environ.pop("TMPDIR", None)
        if before is not None:
            os.environ["TMPDIR"] = before
        tempfile.tempdir = None
        shutil.rmtree(folder, ignore_errors=True)


def _remove_if_left(folder):
    with contextlib.suppress(OSError):
        if folder.is_symlink() or folder.stat().st_uid != os.getuid():
            return
        with open(folder / _LOCK, "rb") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            shutil.rmtree(folder, ignore_errors=True)
