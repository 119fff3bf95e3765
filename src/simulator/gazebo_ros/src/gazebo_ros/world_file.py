# SPDX-License-Identifier: BSD-3-Clause
"""Finds and reads world files. ROS-free."""
from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from sdf_model import SdfError, parse_sdf_world

if TYPE_CHECKING:
    from collections.abc import Iterable

    from sdf_model import ModelFolders, SdfWorld


class WorldFileError(Exception):
    """The world file cannot be used; the text names the file, and the line where there is one."""


def find_world(name: str | Path, folders: Iterable[str | Path]) -> Path:
    """Path of the world file ``name``: itself if it is there, else below one of ``folders``.

    Raises :class:`WorldFileError`, which lists the searched files, and the worlds where they could have been.
    """
    candidates = list(dict.fromkeys([Path(name), *(Path(folder) / name for folder in folders)]))
    for path in candidates:
        if path.is_file():
            return path
    there = sorted({path.name for candidate in candidates for path in candidate.parent.glob("*.world")})
    raise WorldFileError("world file '%s' not found; looked for %s; %s" % (
        name, ", ".join(map(str, candidates)), "there is " + ", ".join(there) if there else "no world is there"))


def read_world(path: str | Path, folders: ModelFolders) -> SdfWorld:
    """The ``sdf_model.SdfWorld`` of the file at ``path``.

    ``folders``: ``sdf_model.ModelFolders``. Raises :class:`WorldFileError`.
    """
    try:
        return parse_sdf_world(path, folders)
    except SdfError as error:
        raise WorldFileError(str(error)) from error
