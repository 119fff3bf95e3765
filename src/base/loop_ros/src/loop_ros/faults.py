# SPDX-License-Identifier: BSD-3-Clause
"""Errors that the loop catches and survives: counted for /diagnostics, logged at a limited rate. ROS-free."""
from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Callable
from typing import Any, Protocol

#: Exceptions of user code that the loop catches. ``sys.exit`` in a callback does not end the simulator.
SURVIVED = (Exception, SystemExit)
#: Shortest time between two log lines about the same place [s, wall time].
LINE_PERIOD_S = 5.0
# Longest text of an error, in a log line and in /diagnostics [characters].
_TEXT_CHARACTERS = 300
# Largest number of places. Topics and services are few; when there are more, the oldest place is dropped.
_MAX_PLACES = 200


class Fault:
    """The errors of one place: their count, and the newest one as text."""

    __slots__ = ("count", "text", "told_s")

    def __init__(self) -> None:
        self.count = 0
        self.text = ""
        self.told_s: float | None = None


class _ErrorLog(Protocol):
    def error(self, text: str) -> object: ...


class Faults:
    """Counts faults by place: a topic, a service, a part of the loop. Callable from any thread."""

    def __init__(self, log: _ErrorLog, clock: Callable[[], float] = time.monotonic) -> None:
        """``log``: ``error(text)``. ``clock`` is replaceable for tests."""
        self._log = log
        self._clock = clock
        #: {place: Fault}, in the order in which places were first noted.
        self.places: dict[str, Fault] = {}

    def note(self, place: str, error: BaseException, consequence: str = "it is left out") -> None:
        """Count ``error`` at ``place``, and log it unless that place was logged recently."""
        fault = self.places.get(place)
        if fault is None:
            fault = self.places[place] = Fault()
            if len(self.places) > _MAX_PLACES:
                with contextlib.suppress(KeyError, StopIteration, RuntimeError):  # another thread has logged it
                    del self.places[next(iter(self.places))]
        fault.count += 1
        fault.text = described(error)
        now = self._clock()
        if fault.told_s is None or now - fault.told_s >= LINE_PERIOD_S:
            fault.told_s = now
            again = "" if fault.count == 1 else " (%d times by now)" % fault.count
            self._log.error("%s: %s; %s%s" % (place, fault.text, consequence, again))

    def guarded(self, place: str, function: Callable[..., Any], *arguments: Any) -> Any:
        """Call ``function(*arguments)`` and return its result. If it raises, count the error and return None."""
        try:
            return function(*arguments)
        except SURVIVED as error:
            self.note(place, error)
            return None


def described(error: BaseException) -> str:
    """An exception in one line: its type, the beginning of its text, and where it was raised."""
    text = " ".join(str(error).split())
    if len(text) > _TEXT_CHARACTERS:
        text = text[:_TEXT_CHARACTERS] + " ..."
    where, trace = "", error.__traceback__
    while trace is not None:
        where = " (%s:%d)" % (os.path.basename(trace.tb_frame.f_code.co_filename), trace.tb_lineno)
        trace = trace.tb_next
    return "%s: %s%s" % (type(error).__name__, text, where)
