# SPDX-License-Identifier: BSD-3-Clause
"""A set that was recorded here: what it has, strips of its films, the set without an episode, and as one file."""
from __future__ import annotations

import shutil
import zipfile
from pathlib import Path
from typing import BinaryIO, NamedTuple

import numpy as np

from . import layout
from .card import write_card
from .frames import DemonstrationError
from .reading import DataSet
from .writing import SetWriter

#: While an episode is taken out, what is left is put together in a folder with this at the end of its name.
_REST = ".rest"


class Listed(NamedTuple):
    """An episode of a set: its number, frames (0 where that is not known), and whether it was a success."""

    number: int
    frames: int
    success: bool


def listed(folder: Path) -> tuple[list[Listed], tuple[str, ...], int]:
    """([Listed], keys of the cameras, frames a second) of a set, by its texts alone. Raises DemonstrationError."""
    schema, info = layout.schema_of(folder)
    outcomes = layout.outcomes_of(folder)
    found = [outcomes.get(number, {}) for number in range(info["total_episodes"])]
    return ([Listed(number, int(row.get("frames") or 0), bool(row.get("success", True)))
             for number, row in enumerate(found)], tuple(schema.cameras), schema.rate_hz)


def strip(folder: Path, number: int, camera: str, count: int = 6, height: int = 60) -> np.ndarray:
    """(height, width, 3) uint8: pictures of an episode's film beside each other, from its first to its last. Raises
    DemonstrationError."""
    data = DataSet(folder)
    if camera not in data.schema.cameras:
        raise DemonstrationError("%s has no camera %s" % (folder, camera))
    wanted = np.linspace(0, max(data.length(number) - 1, 0), count).round().astype(int).tolist()
    parts = []
    for index, pixels in enumerate(data.pictures(number, camera)):
        parts += [_smaller(pixels, height)] * wanted.count(index)
    if not parts:
        raise DemonstrationError("episode %d of %s has no pictures" % (number, folder))
    return np.concatenate(parts, axis=1)


def _smaller(pixels: np.ndarray, height: int) -> np.ndarray:
    """By the mean of squares of pixels; a picture that is lower stays as it is."""
    step = max(pixels.shape[0] // height, 1)
    rows, columns = (side // step for side in pixels.shape[:2])
    parts = pixels[:rows * step, :columns * step].reshape(rows, step, columns, step, 3)
    return parts.mean(axis=(1, 3)).astype(np.uint8)


def delete(folder: Path, number: int) -> None:
    """Take an episode out of a set; those after it move up. The set is then as it would be without it, or, where that
    fails, as it was before. Raises DemonstrationError for a set of other programs, with several episodes in a file."""
    folder, rest = Path(folder), Path(folder).with_name(folder.name + _REST)
    shutil.rmtree(rest, ignore_errors=True)
    try:
        data = DataSet(folder)
        data.episode(number)
        with SetWriter(folder, data.schema):  # nobody else writes there meanwhile
            with SetWriter(rest, data.schema) as writer:
                for other in range(len(data)):
                    if other != number:
                        writer.adopt(data.episode(other), *data.films(other))
            _exchange(folder, rest, is_empty=len(data) == 1)
    except OSError as error:
        raise DemonstrationError("episode %d stays in %s: %s" % (number, folder, error)) from error
    finally:
        shutil.rmtree(rest, ignore_errors=True)


def _exchange(folder: Path, rest: Path, is_empty: bool) -> None:
    old = folder.with_name(folder.name + ".old")
    shutil.rmtree(old, ignore_errors=True)
    folder.rename(old)
    try:
        if is_empty:
            folder.mkdir()
        else:
            rest.rename(folder)
    except OSError:
        old.rename(folder)
        raise
    shutil.rmtree(old, ignore_errors=True)


def write_zip(folder: Path, file: BinaryIO) -> None:
    """A set with its card as one file: its own name, and its files below. Films are compressed already, and stay
    as they are. Raises DemonstrationError, OSError."""
    write_card(folder)
    with zipfile.ZipFile(file, "w") as archive:
        for path in sorted(Path(folder).rglob("*")):
            if path.is_file() and layout.DRAFTS not in path.parts and path.suffix != layout.PART:
                archive.write(path, Path(folder.name) / path.relative_to(folder))
