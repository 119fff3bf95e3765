# SPDX-License-Identifier: BSD-3-Clause
"""The log of the loop. A thread writes the lines, because a terminal or /rosout may block and the loop must not."""
from __future__ import annotations

import collections
import contextlib
import sys
import threading
import time
from collections.abc import Callable, Mapping
from types import CodeType

# Longest line; the rest is cut off [characters].
LONGEST_LINE = 4000


class LoopLog:
    """``info``, ``warn``, ``error`` and their throttled variants; callable from every thread.

    ``sinks`` maps "info", "warn", "error" to functions of one text.
    """

    def __init__(self, sinks: Mapping[str, Callable[[str], object]],
                 clock: Callable[[], float] = time.monotonic) -> None:
        """Starts the writing thread."""
        self._sinks = sinks
        self._clock = clock
        self._lines: collections.deque[tuple[str, str]] = collections.deque()
        self._wake = threading.Event()
        self._ending = False
        self._last: dict[tuple[CodeType, int], float] = {}
        self._thread = threading.Thread(target=self._write, name="loop_log", daemon=True)
        self._thread.start()

    def info(self, text: str) -> None:
        """Log at level info."""
        self._post("info", text)

    def warn(self, text: str) -> None:
        """Log at level warning."""
        self._post("warn", text)

    def error(self, text: str) -> None:
        """Log at level error."""
        self._post("error", text)

    def info_throttle(self, period_s: float, text: str) -> None:
        """As :meth:`info`, at most once in ``period_s`` wall seconds from the same place in the code."""
        self._post_throttled("info", period_s, text)

    def warn_throttle(self, period_s: float, text: str) -> None:
        """As :meth:`warn`, at most once in ``period_s`` wall seconds from the same place in the code."""
        self._post_throttled("warn", period_s, text)

    def error_throttle(self, period_s: float, text: str) -> None:
        """As :meth:`error`, at most once in ``period_s`` wall seconds from the same place in the code."""
        self._post_throttled("error", period_s, text)

    def close(self) -> None:
        """Write the pending lines and end the thread."""
        self._ending = True
        self._wake.set()
        self._thread.join(0.3)

    def _post(self, level: str, text: str) -> None:
        # Lines quote what clients send. It may be a megabyte long, or contain half a surrogate pair, which cannot be
        # written.
        if len(text) > LONGEST_LINE:
            text = "%s ... (%d characters more)" % (text[:LONGEST_LINE], len(text) - LONGEST_LINE)
        self._lines.append((level, text.encode("utf-8", "replace").decode("utf-8")))
        self._wake.set()

    def _post_throttled(self, level: str, period_s: float, text: str) -> None:
        caller = sys._getframe(2)
        place = (caller.f_code, caller.f_lineno)
        now = self._clock()
        if now - self._last.get(place, -period_s) >= period_s:
            self._last[place] = now
            self._post(level, text)

    def _write(self) -> None:
        while True:
            self._wake.wait()
            self._wake.clear()
            while self._lines:
                level, text = self._lines.popleft()
                # A closed terminal must not end this thread: pending lines would then pile up.
                with contextlib.suppress(Exception):
                    self._sinks[level](text)
            if self._ending:
                return
