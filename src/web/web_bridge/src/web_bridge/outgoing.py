# SPDX-License-Identifier: BSD-3-Clause
"""Messages that wait for one client: bounded, the oldest messages dropped. No ROS, any thread."""
from __future__ import annotations

import threading
from collections import OrderedDict, deque
from collections.abc import Callable, Sequence

#: Messages of topics that wait for one client [bytes].
DROPPABLE_BYTES = 16 << 20
#: Answers that wait for one client [bytes]; a client that does not read them is of no use, and is closed.
KEPT_BYTES = 64 << 20


class OutgoingBuffer:
    """Entries of one or more frames (bytes or text), each sent whole or not at all.

    ``wake()`` is called, on the thread of the caller, when there is something to take after there was nothing, and when
    the buffer closes. Messages of topics are droppable: beyond ``droppable_bytes`` the oldest goes, but the newest
    always stays. Answers are kept; beyond ``kept_bytes`` the buffer is ``overflowed`` and takes nothing more.
    """

    def __init__(self, wake: Callable[[], object], droppable_bytes: int = DROPPABLE_BYTES,
                 kept_bytes: int = KEPT_BYTES) -> None:
        self._wake = wake
        self._limits = (droppable_bytes, kept_bytes)
        self._lock = threading.Lock()
        self._kept = deque()  # (number, frames)
        self._droppable = OrderedDict()  # number -> (frames, size, key)
        self._of_key = {}  # key -> numbers, oldest first; only of keys with a limit
        self._sizes = [0, 0]
        self._number = 0
        self._is_idle = True  # the last take() found nothing
        self.dropped = 0
        self.overflowed = False
        self.closed = False

    @property
    def kept_bytes(self) -> int:
        """Answers that wait [bytes]."""
        return self._sizes[1]

    def keep(self, frames: Sequence[str | bytes]) -> None:
        """Append an entry that is never dropped."""
        size = sum(map(len, frames))
        with self._lock:
            if self.closed or self.overflowed:
                return
            self._number += 1
            self._kept.append((self._number, frames))
            self._sizes[1] += size
            self.overflowed = self._sizes[1] > self._limits[1]
        self._wake_if_idle()

    def offer(self, frames: Sequence[str | bytes], key: str | None = None, at_most: int = 0) -> None:
        """Append an entry that may be dropped; of a key at most ``at_most`` entries wait (0: no such limit)."""
        size = sum(map(len, frames))
        with self._lock:
            if self.closed or self.overflowed:
                return
            self._number += 1
            self._droppable[self._number] = (frames, size, key if at_most else None)
            self._sizes[0] += size
            if at_most:
                waiting = self._of_key.setdefault(key, deque())
                waiting.append(self._number)
                while len(waiting) > at_most:
                    self._drop(waiting[0])
            while self._sizes[0] > self._limits[0] and len(self._droppable) > 1:
                self._drop(next(iter(self._droppable)))
        self._wake_if_idle()

    def take(self) -> Sequence[str | bytes] | None:
        """The frames of the oldest entry, or None."""
        with self._lock:
            number = next(iter(self._droppable), None)
            if self._kept and (number is None or self._kept[0][0] < number):
                frames = self._kept.popleft()[1]
                self._sizes[1] -= sum(map(len, frames))
                return frames
            self._is_idle = number is None
            return None if number is None else self._remove(number)

    def close(self) -> None:
        """Forget everything, and accept nothing more."""
        with self._lock:
            self.closed = True
            self._kept.clear()
            self._droppable.clear()
            self._of_key.clear()
            self._sizes = [0, 0]
        self._wake()

    def _wake_if_idle(self) -> None:
        with self._lock:
            is_idle, self._is_idle = self._is_idle, False
        if is_idle:
            self._wake()

    def _drop(self, number: int) -> None:
        self._remove(number)
        self.dropped += 1

    def _remove(self, number: int) -> Sequence[str | bytes]:
        frames, size, key = self._droppable.pop(number)
        self._sizes[0] -= size
        if key is not None:
            waiting = self._of_key[key]
            waiting.remove(number)
            if not waiting:
                del self._of_key[key]
        return frames
