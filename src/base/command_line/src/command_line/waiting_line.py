# SPDX-License-Identifier: BSD-3-Clause
"""One line about a wait. Free of ROS."""
from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import TextIO

# Shortest time between two lines on a stream that is not a terminal [s].
AGAIN_AFTER_S = 30.0


class WaitingLine:
    """Shows what a program waits for: on a terminal one line that counts the seconds, elsewhere one permanent line.

    Parameters: `stream` is a text stream, None for the standard error of the moment; `now` is a clock [s].
    Attribute `again_after_s`: shortest time between two permanent lines [s].
    """

    def __init__(self, stream: TextIO | None = None, again_after_s: float = AGAIN_AFTER_S,
                 now: Callable[[], float] = time.monotonic) -> None:
        self.again_after_s = again_after_s
        self._stream = stream
        self._now = now
        self._said_at_s: float | None = None
        self._shown = ""
        self._last = ""

    def say(self, what: str, waited_s: float) -> None:
        """Show that the program has waited for `what` for `waited_s` [s]; may be called at any rate."""
        stream = sys.stderr if self._stream is None else self._stream
        if stream.isatty():
            line = "waiting for %s: %.0f s" % (what, waited_s)
            if line != self._shown:
                # \r and "erase the line": every terminal understands these.
                stream.write("\r\033[K" + line)
                stream.flush()
                self._shown = line
        elif what != self._last and (self._said_at_s is None or self._now() - self._said_at_s >= self.again_after_s):
            stream.write("waiting for %s ...\n" % what)
            stream.flush()
            self._said_at_s, self._last = self._now(), what

    def note(self, text: str) -> None:
        """Write a line that stays, such as a reason for the wait."""
        self.end()
        stream = sys.stderr if self._stream is None else self._stream
        stream.write(text + "\n")
        stream.flush()

    def end(self) -> None:
        """The wait is over: erase the line from the terminal."""
        if self._shown:
            stream = sys.stderr if self._stream is None else self._stream
            stream.write("\r\033[K")
            stream.flush()
            self._shown = ""
