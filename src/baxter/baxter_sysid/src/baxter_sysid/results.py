# SPDX-License-Identifier: BSD-3-Clause
"""Files of results: whether they can be written, before a robot moves for them; whole or not there; and what was there
before is kept."""
from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from disk_cache.files import draft_of, try_room

_ROOM_BYTES = 1_000_000


def why_not(path: Path) -> str:
    """Why a file cannot be written there, or ""."""
    path = path.resolve()
    if path.is_dir():
        return "it is a folder; a file's name would be right"
    if path.exists() and not path.is_file():
        return "it is no regular file"
    if not path.parent.is_dir():
        return "there is no folder %s" % path.parent
    try:
        try_room(path.parent, _ROOM_BYTES)
    except OSError as error:
        return "no file can be made in %s: %s" % (path.parent, error.strerror or error)
    return ""


def put(path: Path, write: Callable[[Path], object]) -> Path | None:
    """Have `write` make a file, which takes its place at the end; raises OSError.

    Returns where the file that was there is now: under the same name with a ~ behind it; None if none was there.
    """
    path = path.resolve()
    former = path.with_name(path.name + "~") if path.exists() else None
    with draft_of(path) as draft:
        write(draft)
        if former is not None:
            os.replace(path, former)
    return former
