# SPDX-License-Identifier: BSD-3-Clause
"""Log lines for events that others can cause at any rate. ROS-free."""
import threading
import time

PERIOD_S = 60.0


class EventLog:
    """One line for the first event of a kind, then at most one a minute, with the count since then."""

    def __init__(self, write, clock=time.monotonic):
        """``write(text)`` takes a line; ``clock`` is replaceable for tests."""
        self._write = write
        self._clock = clock
        self._lock = threading.Lock()
        self._kinds = {}

    def add(self, kind, text):
        """Any thread: note an event of ``kind`` (hashable); ``text`` describes it."""
        now = self._clock()
        with self._lock:
            last, untold = self._kinds.get(kind, (None, 0))
            if last is not None and now - last < PERIOD_S:
                self._kinds[kind] = last, untold + 1
                return
            self._kinds[kind] = now, 0
        self._write("%s (and %d more since the last line about it)" % (text, untold) if untold else text)
