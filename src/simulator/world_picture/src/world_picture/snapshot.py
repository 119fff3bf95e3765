# SPDX-License-Identifier: BSD-3-Clause
"""The state of the world in shared memory, for processes that draw it. ROS-free.

One folder per simulator, in memory where the system has ``/dev/shm``: ``state`` (time, and per body base pose and joint
angles, rewritten many times a second) and ``scene.json`` (which bodies there are, rewritten when that changes). The
simulator holds a lock on ``state``, so a folder whose lock is free belonged to a dead simulator.

``state`` begins with a header (magic, sequence number) and has two slots. The writer fills the one that is not current,
then raises the sequence number; a slot carries its own number, which is zero during a write, so a reader notices an
interrupted read and tries again. A slot is: number, scene revision, how many times simulation time was reset, tick,
count of values, time [s], whether the world is paused, then the values. Of each body, in the scene's order: position x
y z [m], quaternion x y z w, joint angles [rad or m].
"""
from __future__ import annotations

import contextlib
import errno
import fcntl
import json
import mmap
import os
import shutil
import stat
import struct
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import IO, Any, BinaryIO, NamedTuple

import numpy as np

MAGIC = 0x42475333
#: Values that a slot holds [float64]; pages that are never written take no memory.
CAPACITY = 65536
_HEADER = struct.Struct("<QQ")
_SLOT = struct.Struct("<QQQQQdQ")
_SLOT_BYTES = _SLOT.size + 8 * CAPACITY
_NUMBER = struct.Struct("<Q")
_PREFIX = "bullet_gazebo-"


class SnapshotError(Exception):
    """There is no snapshot, or it has another version or size."""


def _shared_memory_folder():
    return Path("/dev/shm") if os.access("/dev/shm", os.W_OK) else Path(tempfile.gettempdir())


def remove_stale(parent: str | os.PathLike[str] | None = None) -> list[Path]:
    """Delete this user's folders of simulators that are gone; returns their paths.

    A link, or a folder of another user, is neither followed nor touched: every user may write to the parent folder.
    """
    parent = _shared_memory_folder() if parent is None else Path(parent)
    removed = []
    for folder in parent.glob("%s%d-*" % (_PREFIX, os.getuid())):
        try:
            with _own_folder(folder) as descriptor:
                try:
                    with _open_in(descriptor, "state") as file:
                        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                        _remove(folder, descriptor)
                        removed.append(folder)
                except FileNotFoundError:
                    # Another simulator has just made this folder, or was removing it; rmdir deletes it only if it is
                    # empty.
                    folder.rmdir()
        except OSError:
            continue
    return removed


def _remove(folder, descriptor):
    for name in os.listdir(descriptor):
        with contextlib.suppress(OSError):
            os.unlink(name, dir_fd=descriptor)
    with contextlib.suppress(OSError):
        folder.rmdir()


@contextlib.contextmanager
def _own_folder(folder):
    """Open a folder that belongs to this user and is not a link; returns the descriptor. Raises ``OSError``."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    try:
        _check_owner(os.fstat(descriptor), folder)
        yield descriptor
    finally:
        os.close(descriptor)


def _open_in(descriptor, name):
    """Open a file of the folder for reading: a regular file of this user. Raises ``OSError``."""
    file = os.open(name, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK, dir_fd=descriptor)
    try:
        status = os.fstat(file)
        _check_owner(status, name)
        if not stat.S_ISREG(status.st_mode):
            raise PermissionError(errno.EPERM, "no plain file", str(name))
        return open(file, "rb")
    except OSError:
        os.close(file)
        raise


def _check_owner(status, path):
    if status.st_uid != os.getuid():
        text = "belongs to user %d, expected %d" % (status.st_uid, os.getuid())
        raise PermissionError(errno.EPERM, text, str(path))


def open_shared(path: str | os.PathLike[str]) -> BinaryIO:
    """Open a file in a simulator's folder for reading. File and folder must belong to this user and be no links. Raises
    ``OSError``."""
    path = Path(path)
    with _own_folder(path.parent) as descriptor:
        return _open_in(descriptor, path.name)


def reserve(file: IO[bytes], size: int, path: str | os.PathLike[str]) -> None:
    """Reserve ``size`` bytes for an open file; raises :class:`SnapshotError`.

    Without it, a write while the machine's memory is full would kill the process (SIGBUS).
    """
    try:
        os.posix_fallocate(file.fileno(), 0, size)
    except OSError as error:
        raise SnapshotError(no_room(path, error)) from error


def no_room(path: str | os.PathLike[str], error: OSError) -> str:
    """The message to the user when the data for viewers cannot be written."""
    return ("cannot write %s: %s; cameras and the window stand still (df -h %s says what is free)"
            % (path, error.strerror or error, Path(path).parent.parent))


def _locked(path):
    """A new file, open and locked for the life of the simulator. None if another simulator has removed it: before it is
    locked, it looks like a left-over."""
    try:
        file = open(path, "w+b")  # noqa: SIM115
    except FileNotFoundError:
        return None
    fcntl.flock(file, fcntl.LOCK_EX)
    if os.fstat(file.fileno()).st_nlink:
        return file
    file.close()
    return None


class NoSnapshot:
    """Replaces :class:`SnapshotWriter` where there is no shared memory: viewers have nothing to draw."""

    folder = None
    revision = resets = 0

    def write_scene(self, bodies: Sequence[Mapping[str, Any]], light: Mapping[str, Any] | None = None) -> None:
        """Does nothing, as the others here."""

    def write(self, tick: int, time_s: float, parts: Iterable[Sequence[float] | np.ndarray],
              paused: bool = False) -> None:
        """Does nothing."""

    def close(self) -> None:
        """Does nothing."""


class SnapshotWriter:
    """The simulator's side."""

    def __init__(self, parent: str | os.PathLike[str] | None = None) -> None:
        """Makes the folder (private to the user) and locks it. Raises :class:`SnapshotError` if there is no space
        left."""
        parent = _shared_memory_folder() if parent is None else Path(parent)
        file = None
        while file is None:
            try:
                prefix = "%s%d-%d-" % (_PREFIX, os.getuid(), os.getpid())
                self.folder = Path(tempfile.mkdtemp(prefix=prefix, dir=parent))
                file = _locked(self.folder / "state")
            except OSError as error:
                raise SnapshotError(no_room(parent / _PREFIX / "state", error)) from error
        self._file = file
        self.revision = 0
        #: How many times simulation time was reset: the same time then means another state.
        self.resets = 0
        self._sequence = 0
        size = _HEADER.size + 2 * _SLOT_BYTES
        try:
            reserve(self._file, size, self.folder / "state")
        except SnapshotError:
            self._file.close()
            shutil.rmtree(self.folder, ignore_errors=True)
            raise
        self._memory = mmap.mmap(self._file.fileno(), size)
        self._values = [np.frombuffer(self._memory, np.float64, CAPACITY, _HEADER.size + k * _SLOT_BYTES + _SLOT.size)
                        for k in range(2)]
        _HEADER.pack_into(self._memory, 0, MAGIC, 0)
        self.write_scene([])

    def write_scene(self, bodies: Sequence[Mapping[str, Any]], light: Mapping[str, Any] | None = None) -> None:
        """Write the list of bodies and the lights.

        ``bodies``: list of dictionaries with ``name``, ``joints`` (names) and whatever a viewer needs to draw it.
        States written from here on refer to this list. ``light``: as from :meth:`WorldLights.listed`. Raises
        :class:`SnapshotError` if it cannot be written; viewers then wait for the next one.
        """
        self.revision += 1
        path = self.folder / "scene.json"
        draft = path.with_suffix(".new")
        try:
            draft.write_text(json.dumps({"revision": self.revision, "bodies": bodies, "light": light or {}}),
                             encoding="utf-8")
            draft.replace(path)
        except OSError as error:
            with contextlib.suppress(OSError):
                draft.unlink(missing_ok=True)
            raise SnapshotError(no_room(path, error)) from error

    def write(self, tick: int, time_s: float, parts: Iterable[Sequence[float] | np.ndarray],
              paused: bool = False) -> None:
        """Write the state: ``parts`` are arrays; concatenated, they are the slot's values. ``paused``: whether time
        stands still.

        Raises ``ValueError`` when they are more than :data:`CAPACITY`.
        """
        number = self._sequence + 1
        slot = number & 1
        offset = _HEADER.size + slot * _SLOT_BYTES
        values = self._values[slot]
        _NUMBER.pack_into(self._memory, offset, 0)
        count = 0
        for part in parts:
            end = count + len(part)
            if end > CAPACITY:
                raise ValueError("the world has more than %d state values, the snapshot's capacity" % CAPACITY)
            values[count:end] = part
            count = end
        _SLOT.pack_into(self._memory, offset, 0, self.revision, self.resets, tick, count, time_s, paused)
        _NUMBER.pack_into(self._memory, offset, number)
        self._sequence = number
        _NUMBER.pack_into(self._memory, 8, number)

    def close(self) -> None:
        """Remove the folder. Readers that have it open keep the last state."""
        self._values = []
        with contextlib.suppress(BufferError):
            self._memory.close()
        with contextlib.suppress(OSError), _own_folder(self.folder) as descriptor:
            _remove(self.folder, descriptor)
        self._file.close()


class WrittenScene(NamedTuple):
    """The arguments of :meth:`SnapshotWriter.write_scene`, and the count of its calls."""

    revision: int
    bodies: list[dict[str, Any]]
    light: dict[str, Any]


class Snapshot:
    """One state: ``tick``, ``time_s``, ``revision`` of the scene, ``resets`` of the time so far, ``values`` (float64
    array, a copy), ``paused``."""

    __slots__ = ("paused", "resets", "revision", "tick", "time_s", "values")

    def __init__(self, revision: int, resets: int, tick: int, time_s: float, values: np.ndarray,
                 paused: bool = False) -> None:
        self.revision = revision
        self.resets = resets
        self.tick = tick
        self.time_s = time_s
        self.values = values
        self.paused = paused


class SnapshotReader:
    """A viewer's side."""

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        """``folder`` as the writer made it; :class:`SnapshotError` when there is none."""
        self._folder = Path(folder)
        try:
            with open_shared(self._folder / "state") as file:
                self._memory = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        except (OSError, ValueError) as error:
            raise SnapshotError("no snapshot in %s: %s" % (folder, error)) from error
        if len(self._memory) < _HEADER.size + 2 * _SLOT_BYTES or _HEADER.unpack_from(self._memory, 0)[0] != MAGIC:
            raise SnapshotError("%s/state is not a snapshot of this version" % folder)

    @property
    def is_alive(self) -> bool:
        """False once the simulator has removed its folder."""
        return (self._folder / "state").exists()

    def read(self) -> Snapshot | None:
        """The newest complete :class:`Snapshot`, or None before the first one."""
        while True:
            _, number = _HEADER.unpack_from(self._memory, 0)
            if number == 0:
                return None
            offset = _HEADER.size + (number & 1) * _SLOT_BYTES
            before, revision, resets, tick, count, time_s, paused = _SLOT.unpack_from(self._memory, offset)
            if before != number or count > CAPACITY:
                continue
            values = np.frombuffer(self._memory, np.float64, count, offset + _SLOT.size).copy()
            if _NUMBER.unpack_from(self._memory, offset)[0] == number:
                return Snapshot(revision, resets, tick, time_s, values, bool(paused))

    def scene(self) -> WrittenScene:
        """The :class:`WrittenScene` as it is now."""
        try:
            with open_shared(self._folder / "scene.json") as file:
                scene = json.loads(file.read().decode("utf-8"))
        except (OSError, ValueError) as error:
            raise SnapshotError("no scene in %s: %s" % (self._folder, error)) from error
        return WrittenScene(scene["revision"], scene["bodies"], scene["light"])
