# SPDX-License-Identifier: BSD-3-Clause
"""Files and folders that are whole or not there, the user's cache, and room on a disk. Free of ROS."""
from __future__ import annotations

import contextlib
import errno
import os
import shutil
import stat
import tempfile
import time
from collections.abc import Iterator, Mapping
from pathlib import Path

#: Begins the names of folders of drafts.
DRAFT = ".draft-"


def cache_home(environment: Mapping[str, str] = os.environ) -> Path:
    """Return ``$XDG_CACHE_HOME``, by default ``~/.cache``."""
    return Path(environment.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache"))


@contextlib.contextmanager
def draft_of(path: str | os.PathLike) -> Iterator[Path]:
    """The path of a draft, a file or folder to be made, which takes the place of ``path`` at the end.

    So nobody finds half of it, and several processes may make it at a time; a link at ``path`` is replaced, not
    followed. The draft has the same name in a hidden folder beside it, for more drafts, which is removed in any case.
    Raises OSError; nothing is left then.
    """
    path = Path(path).absolute()
    folder = tempfile.mkdtemp(prefix=DRAFT, dir=path.parent)
    try:
        draft = Path(folder, path.name)
        yield draft
        os.replace(draft, path)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def replace_text(path: str | os.PathLike, text: str) -> None:
    """Write a file that only the user can read; nobody finds half of it. Raises OSError."""
    with draft_of(path) as draft:
        draft.touch(mode=0o600)
        draft.write_text(text, encoding="utf-8")


def remove_drafts(folder: Path, older_than_s: float = 0.0) -> None:
    """Remove the drafts of :func:`draft_of` of programs that were killed [s ago]. Raises OSError."""
    for draft in folder.glob(DRAFT + "*"):
        with contextlib.suppress(FileNotFoundError):  # another process removes them, too
            if not draft.is_symlink() and time.time() - draft.stat().st_mtime >= older_than_s:
                shutil.rmtree(draft, ignore_errors=True)


def try_room(folder: str | os.PathLike, size: int) -> None:
    """Raises OSError where a file of ``size`` bytes cannot be made in ``folder``."""
    with tempfile.TemporaryFile(dir=str(folder)) as file:
        os.posix_fallocate(file.fileno(), 0, size)


def spare_folder(name: str) -> Path:
    """The path of this user's folder ``name_UID`` among temporary files, for results that their own folder cannot take.

    It is the same in all processes: nodes that are ended at once delete nothing. Raises OSError, also where the folder
    is not this user's alone.
    """
    folder = Path(tempfile.gettempdir()) / ("%s_%d" % (name, os.getuid()))
    folder.mkdir(mode=0o700, exist_ok=True)
    status = os.lstat(folder)
    if not stat.S_ISDIR(status.st_mode) or status.st_uid != os.getuid() or status.st_mode & 0o077:
        raise PermissionError(errno.EPERM, "it is not a folder of this user alone", str(folder))
    return folder
