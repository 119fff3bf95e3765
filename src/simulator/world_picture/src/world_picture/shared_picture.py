# SPDX-License-Identifier: BSD-3-Clause
"""A picture in shared memory, beside the snapshot: what a screen in the world shows. ROS-free.

The file begins with width, height and a sequence number, odd while the picture is being written; then come the rows of
red, green, blue. A reader that reads during a write notices it and gets the picture at its next call.
"""
from __future__ import annotations

import mmap
import os
import struct
from pathlib import Path

import numpy as np

from world_picture.snapshot import SnapshotError, no_room, open_shared, reserve

_HEADER = struct.Struct("<QQQ")
_SEQUENCE = struct.Struct("<Q")
_SEQUENCE_AT = 16


class PictureWriter:
    """The simulator's side; the picture is black at first."""

    def __init__(self, path: Path, width: int, height: int) -> None:
        """``path``: a file that is not there yet; ``width``, ``height`` [pixels]. Raises ``SnapshotError`` if there is
        no space left."""
        self.path = path
        self._sequence = 0
        size = _HEADER.size + 3 * width * height
        try:
            file = open(path, "xb+")  # noqa: SIM115
        except OSError as error:
            raise SnapshotError(no_room(path, error)) from error
        with file:
            try:
                reserve(file, size, path)
            except SnapshotError:
                path.unlink()
                raise
            self._memory = mmap.mmap(file.fileno(), size)
        _HEADER.pack_into(self._memory, 0, width, height, 0)
        self._pixels = np.frombuffer(self._memory, np.uint8, 3 * width * height, _HEADER.size).reshape(height, width, 3)

    def show(self, pixels: np.ndarray) -> None:
        """Show ``pixels`` (height, width, 3), uint8, red first."""
        _SEQUENCE.pack_into(self._memory, _SEQUENCE_AT, self._sequence + 1)
        self._pixels[:] = pixels
        self._sequence += 2
        _SEQUENCE.pack_into(self._memory, _SEQUENCE_AT, self._sequence)

    def close(self) -> None:
        """Remove the file. Readers that have it open keep the last picture."""
        self.path.unlink(missing_ok=True)


class NoPicture:
    """Replaces :class:`PictureWriter` where there is no shared memory: nobody sees the picture."""

    def show(self, pixels: np.ndarray) -> None:
        """Does nothing."""

    def close(self) -> None:
        """Does nothing."""


class PictureReader:
    """A viewer's side. ``width``, ``height`` [pixels]."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        """Raises ``SnapshotError`` when there is no picture."""
        try:
            with open_shared(path) as file:
                self._memory = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        except (OSError, ValueError) as error:
            raise SnapshotError("no picture in %s: %s" % (path, error)) from error
        self.width, self.height, _ = _HEADER.unpack_from(self._memory, 0)
        if len(self._memory) < _HEADER.size + 3 * self.width * self.height:
            raise SnapshotError("%s is shorter than a picture of %d x %d" % (path, self.width, self.height))
        self._seen = None

    @property
    def version(self) -> int:
        """The number of the newest picture that is complete; 0 is the first, black one."""
        return _SEQUENCE.unpack_from(self._memory, _SEQUENCE_AT)[0] // 2

    def read(self) -> np.ndarray | None:
        """The picture (height, width, 3), a copy, if it has changed since the last call; else None."""
        sequence, = _SEQUENCE.unpack_from(self._memory, _SEQUENCE_AT)
        if sequence == self._seen or sequence % 2:
            return None
        pixels = np.frombuffer(self._memory, np.uint8, 3 * self.width * self.height, _HEADER.size).copy()
        if _SEQUENCE.unpack_from(self._memory, _SEQUENCE_AT)[0] != sequence:
            return None
        self._seen = sequence
        return pixels.reshape(self.height, self.width, 3)
