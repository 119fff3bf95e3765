# SPDX-License-Identifier: BSD-3-Clause
"""Meshes and pictures that are simplified in threads, while their viewer goes on. ROS-free."""
from __future__ import annotations

import collections
import os
import threading
import time
from collections.abc import Callable, Iterable

from bullet_sim.limited_process import LimitedProcess, LimitError
from world_picture.drawing import LIMITS, DrawingCache

#: Smaller files are waited for, within :data:`PATIENCE_S`: one of this size [bytes] has about 100,000 triangles, and
#: takes some seconds.
LARGE_BYTES = 8_000_000
#: So long the smaller meshes of a scene are waited for, all together [s]. It is enough on a machine that is not busy:
#: models with ordinary meshes are in their first picture. On a busy one, viewers go on without them.
PATIENCE_S = 8.0


class NotReady(Exception):
    """A mesh or picture is being simplified; ``key`` names it for :meth:`BackgroundDrawings.is_making`."""

    def __init__(self, key: str) -> None:
        super().__init__("%s is being simplified" % key)
        self.key = key


class BackgroundDrawings(DrawingCache):
    """A :class:`world_picture.drawing.DrawingCache` that raises :class:`NotReady` instead of waiting: at once for a
    large mesh, and for others when :data:`PATIENCE_S` are over. One that cannot be used is not tried again as long as
    its file stays the same."""

    def __init__(self, folder: str | os.PathLike[str] | None = None, patience_s: float = PATIENCE_S,
                 clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__(folder)
        self._patience_s, self._clock = patience_s, clock
        self._patient_until = clock() + patience_s
        # Separate processes: smaller meshes do not wait for large ones.
        self._caches = {is_large: DrawingCache(folder, LimitedProcess(**LIMITS)) for is_large in (False, True)}
        self._jobs = {is_large: collections.deque() for is_large in self._caches}
        self._changed = threading.Condition()
        self._made = {}  # by key: the file, a LimitError, or None while it is being made
        self._working = set()

    def begin_scene(self) -> None:
        """Be patient again."""
        self._patient_until = self._clock() + self._patience_s

    def is_making(self, keys: Iterable[str]) -> bool:
        """Whether one of ``keys`` is still being simplified."""
        with self._changed:
            return any(key in self._made and self._made[key] is None for key in keys)

    def wait(self, timeout_s: float) -> None:
        """Wait until nothing is being simplified, at most ``timeout_s`` [s]."""
        with self._changed:
            self._changed.wait_for(lambda: not self._working, timeout_s)

    def _make(self, key, name, write, path, *arguments):
        is_large = os.path.getsize(path) >= LARGE_BYTES
        with self._changed:
            made = self._made.get(key)
            if key not in self._made or not (made is None or isinstance(made, LimitError) or made.exists()):
                self._made[key] = None
                self._jobs[is_large].append((key, name, write, path, *arguments))
                if is_large not in self._working:
                    self._working.add(is_large)
                    threading.Thread(target=self._work, args=(is_large,), name="drawings", daemon=True).start()
            if not is_large:
                self._changed.wait_for(lambda: self._made[key] is not None,
                                       max(0.0, self._patient_until - self._clock()))
            made = self._made[key]
        if made is None:
            raise NotReady(key)
        if isinstance(made, LimitError):
            raise made
        return made

    def _work(self, is_large):
        while True:
            with self._changed:
                if not self._jobs[is_large]:
                    self._working.discard(is_large)
                    self._changed.notify_all()
                    return
                key, *job = self._jobs[is_large].popleft()
            try:
                made = self._caches[is_large]._make(key, *job)
            except LimitError as error:
                made = error
            except OSError as error:  # no room on the disk
                made = LimitError(str(error))
            except Exception as error:  # noqa: BLE001  (one mesh must not keep all later ones from being drawn)
                made = LimitError("%s: %s" % (type(error).__name__, error))
            with self._changed:
                self._made[key] = made
                self._changed.notify_all()
