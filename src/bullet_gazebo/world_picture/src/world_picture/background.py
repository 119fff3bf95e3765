# SPDX-License-Identifier: BSD-3-Clause
"""Large meshes that are simplified in a thread, while their viewer goes on. ROS-free."""
import collections
import os
import threading

from bullet_sim.limited import LimitedProcess, LimitError
from world_picture.drawing import LIMITS, DrawingCache, write_parts

#: Smaller mesh files are waited for: one of this size [bytes] has about 100,000 triangles, and takes some seconds.
#: The choice does not depend on the machine's speed, so that models with ordinary meshes are in their first picture.
LARGE_BYTES = 8_000_000


class NotReady(Exception):
    """A mesh is being simplified; ``key`` names it for :meth:`BackgroundDrawings.is_making`."""

    def __init__(self, key):
        super().__init__("%s is being simplified" % key)
        self.key = key


class BackgroundDrawings(DrawingCache):
    """A :class:`world_picture.drawing.DrawingCache` that raises :class:`NotReady` instead of waiting for a large mesh.
    One that cannot be used is not tried again as long as its file stays the same."""

    def __init__(self, folder=None):
        super().__init__(folder)
        # A separate process: smaller meshes do not wait for large ones.
        self._behind = DrawingCache(folder, LimitedProcess(**LIMITS))
        self._changed = threading.Condition()
        self._made = {}  # by key: the file, a LimitError, or None while it is being made
        self._jobs = collections.deque()
        self._is_working = False

    def is_making(self, keys):
        """Whether one of ``keys`` is still being simplified."""
        with self._changed:
            return any(key in self._made and self._made[key] is None for key in keys)

    def wait(self, timeout_s):
        """Wait until nothing is being simplified, at most ``timeout_s`` [s]."""
        with self._changed:
            self._changed.wait_for(lambda: not self._is_working, timeout_s)

    def _make(self, key, name, write, path, *arguments):
        if write is not write_parts or os.path.getsize(path) < LARGE_BYTES:
            return super()._make(key, name, write, path, *arguments)
        with self._changed:
            made = self._made.get(key)
            if isinstance(made, LimitError):
                raise made
            if made is not None and made.exists():
                return made
            if made is not None or key not in self._made:
                self._made[key] = None
                self._jobs.append((key, name, write, path, *arguments))
                if not self._is_working:
                    self._is_working = True
                    threading.Thread(target=self._work, name="drawings", daemon=True).start()
        raise NotReady(key)

    def _work(self):
        while True:
            with self._changed:
                if not self._jobs:
                    self._is_working = False
                    self._changed.notify_all()
                    return
                key, *job = self._jobs.popleft()
            try:
                made = self._behind._make(key, *job)
            except LimitError as error:
                made = error
            except OSError as error:  # no room on the disk
                made = LimitError(str(error))
            with self._changed:
                self._made[key] = made
