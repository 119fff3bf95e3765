# SPDX-License-Identifier: BSD-3-Clause
"""Results of long calculations, kept on disk. ROS-free."""
from __future__ import annotations

import contextlib
import hashlib
import os
from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np
import numpy.typing as npt

from disk_cache.files import cache_home, draft_of

#: This variable names a folder as :func:`cache_folder` has them, which is only read: results of another user.
READY = "BULLET_GAZEBO_READY"
#: Most results that are kept. Models of ever other sizes, as for data sets, would fill the disk.
MAX_KEPT = 5000
_FOLDER = "results"


def cache_folder(name: str) -> Path:
    """The path of a folder below ``$XDG_CACHE_HOME/bullet_gazebo``, by default ``~/.cache/bullet_gazebo``."""
    return cache_home() / "bullet_gazebo" / name


def existing(folder: Path, name: str | os.PathLike[str], cache: str) -> Path | None:
    """The path ``name`` in ``folder``, or else in the folder of ``cache`` that :data:`READY` has, if it is there; None
    if it is in neither. ``cache``: as for :func:`cache_folder`."""
    ready = os.environ.get(READY)
    for place in (folder, *([Path(ready) / cache] if ready else ())):
        if os.path.exists(place / name):  # unlike Path.exists, False for a folder that may not be read
            return place / name
    return None


def ready_for(home: str) -> tuple[list[tuple[Path, str, bool]], dict[str, str]]:
    """This user's results for a sandbox in which ``home`` is the home: (binds for ``isolation.command``, variables of
    the environment there); without results none. They save ten seconds of a processor for a robot's meshes."""
    folder, place = cache_folder(""), os.path.join(home, ".cache", "bullet_gazebo_ready")
    return ([(folder, place, False)], {READY: place}) if folder.is_dir() else ([], {})


def open_to_all(path: str | os.PathLike[str]) -> None:
    """Let all users read a new file or folder, whatever the umask: it may be another user's :data:`READY`."""
    os.chmod(path, 0o755 if os.path.isdir(path) else 0o644)


class ResultCache:
    """Arrays on disk, under a hash of what they were calculated from. Several processes may use a folder at a time; a
    folder that cannot be written to keeps nothing. Of more than :data:`MAX_KEPT` results, those that were used last
    are kept."""

    def __init__(self, folder: str | os.PathLike[str] | None = None) -> None:
        """``folder``: default ``$XDG_CACHE_HOME/bullet_gazebo/results``."""
        self._folder = Path(folder or cache_folder(_FOLDER))

    def array(self, calculation: str, inputs: Iterable[npt.ArrayLike],
              calculate: Callable[[], np.ndarray]) -> np.ndarray:
        """The array that ``calculate()`` returns, from the disk if it is there. ``calculation``: a name, with a number
        to be increased when the result for the same inputs changes; ``inputs``: arrays and numbers, on which alone it
        depends."""
        name = "%s-%s.npy" % (calculation, _digest(inputs))
        path = existing(self._folder, name, _FOLDER) or self._folder / name
        # Missing, cut short, or of something else: it is calculated again.
        with contextlib.suppress(OSError, ValueError, EOFError):
            result = np.load(path, allow_pickle=False)
            with contextlib.suppress(OSError):  # it is only read here
                os.utime(path)
            return result
        result = calculate()
        with contextlib.suppress(OSError):
            self._write(self._folder / name, result)
        return result

    def _write(self, path, result):
        self._folder.mkdir(parents=True, exist_ok=True)
        with draft_of(path) as draft:
            np.save(draft, result, allow_pickle=False)
            open_to_all(draft)
        self._make_room()

    def _make_room(self):
        used_at = []
        for entry in self._folder.glob("*.npy"):
            with contextlib.suppress(FileNotFoundError):  # another process makes room as well
                used_at.append((entry.stat().st_mtime_ns, entry))
        # A tenth at once, so that the next ones find room.
        if len(used_at) > MAX_KEPT:
            for _, path in sorted(used_at)[:len(used_at) - MAX_KEPT + MAX_KEPT // 10]:
                with contextlib.suppress(FileNotFoundError):
                    os.unlink(path)


def _digest(inputs):
    digest = hashlib.sha256()
    for value in inputs:
        value = np.ascontiguousarray(value)
        digest.update(("%s %s " % (value.dtype.str, value.shape)).encode())
        digest.update(value.tobytes())
    return digest.hexdigest()[:32]
