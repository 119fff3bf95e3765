# SPDX-License-Identifier: BSD-3-Clause
"""Log lines for events that others can cause at any rate. ROS-free."""
from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Hashable

PERIOD_S = 60.0
# A line quotes what others send. Its longest text [characters]; kinds that are remembered, the oldest are forgotten.
LONGEST_LINE, MAX_KINDS = 1000, 1000


def printable(text: str) -> str:
    """``text`` in one line of at most LONGEST_LINE characters: a terminal must not obey what a stranger sends."""
    if len(text) > LONGEST_LINE:
        text = "%s ... (%d characters more)" % (text[:LONGEST_LINE], len(text) - LONGEST_LINE)
    return "".join(sign if sign.isprintable() else ascii(sign)[1:-1] for sign in text)


class EventLog:
    """One line for the first event of a kind, then at most one a minute, with the count since then."""

    def __init__(self, write: Callable[[str], object], clock: Callable[[], float] = time.monotonic) -> None:
        """``write(text)`` takes a line; ``clock`` is replaceable for tests."""
        self._write = write
        self._clock = clock
        self._lock = threading.Lock()
        self._kinds: dict[Hashable, tuple[float, int]] = {}

    def add(self, kind: Hashable, text: str) -> None:
        """Any thread: note an event of ``kind`` (hashable); ``text`` describes it."""
        now = self._clock()
        with self._lock:
            last, untold = self._kinds.get(kind, (None, 0))
            if last is not None and now - last < PERIOD_S:
                self._kinds[kind] = last, untold + 1
                return
            self._kinds.pop(kind, None)
            self._kinds[kind] = now, 0
            if len(self._kinds) > MAX_KINDS:
                del self._kinds[next(iter(self._kinds))]
        text = printable(text)
        with contextlib.suppress(Exception):  # what the log meets must not end the thread that serves others
            self._write("%s (and %d more since the last line about it)" % (text, untold) if untold else text)
