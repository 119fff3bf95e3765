# SPDX-License-Identifier: BSD-3-Clause
"""Threads that serve others: they outlive errors that nobody foresaw, and every thread's end by an error is counted.
ROS-free."""
from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable
from typing import Any, Protocol

from rospy_fixes.ports.event_log import EventLog

#: Exceptions that do not end a thread that serves others.
SURVIVED = (Exception, SystemExit)
#: Between an error of a loop and its next try [s]: an error that comes each time must not fill a processor.
RETRY_S = 0.1
#: The ending of the name of the status on /diagnostics; before it stands the node's name, or what it is called there.
STATUS_NAME = "threads"
# Kinds of threads that are told apart; beyond it, the oldest is forgotten. Longest text of an error [characters].
_MAX_PLACES, _LONGEST_TEXT = 100, 300


class Noting(Protocol):
    """Counts errors: :class:`ThreadFaults` or ``loop_ros.faults.Faults``."""

    def note(self, place: str, error: BaseException, consequence: str) -> object: ...


def lasting(faults: Noting, place: str, loop: Callable, retry_s: float = RETRY_S) -> Callable:
    """A function of ``ends`` that runs ``loop(ends)`` until it returns, and again after each error.

    ``faults`` counts them.
    """
    def run(ends: Callable[[], bool]) -> None:
        while True:
            try:
                loop(ends)
                return
            except SURVIVED as error:
                with contextlib.suppress(Exception):  # a full disk, a log that is closed
                    faults.note(place, error, "it goes on")
            if ends():
                return
            time.sleep(retry_s)
    return run


class ThreadFaults:
    """How often threads were restarted, or ended, by an error. Any thread."""

    def __init__(self, events: EventLog) -> None:
        """``events``: :class:`rospy_fixes.ports.event_log.EventLog`."""
        self._events = events
        self._lock = threading.Lock()
        self._places = {}  # {place: (count, text of the newest error)}, in the order of their first errors
        #: Set at each error; for whoever publishes the :meth:`summary`.
        self.news = threading.Event()

    def note(self, place: str, error: BaseException, consequence: str = "it has ended") -> None:
        """Count an error of the thread ``place``, and log it at a limited rate."""
        text = "%s: %s" % (type(error).__name__, str(error)[:_LONGEST_TEXT])
        with self._lock:
            count, _ = self._places.get(place, (0, ""))
            self._places[place] = count + 1, text
            if len(self._places) > _MAX_PLACES:
                del self._places[next(iter(self._places))]
        self.news.set()
        self._events.add(("thread", place), "thread %s: %s; %s" % (place, text, consequence))

    def summary(self) -> tuple[str, dict[str, str]] | None:
        """(one line, {thread: how often and the newest error}), or None without any."""
        with self._lock:
            places = dict(self._places)
        if not places:
            return None
        total = sum(count for count, _ in places.values())
        return ("%d times a thread met an error that was not foreseen: %s" % (total, ", ".join(places)),
                {place: "%d, the newest: %s" % row for place, row in places.items()})

    def count_ends(self, hook: Callable) -> Callable:
        """A ``threading.excepthook`` that counts the threads that an error ends, and then calls ``hook``."""
        def ended(arguments: Any) -> None:
            if arguments.exc_value is not None and not isinstance(arguments.exc_value, SystemExit):
                with contextlib.suppress(Exception):
                    name = arguments.thread.name if arguments.thread is not None else "without a name"
                    self.note(_kind(name), arguments.exc_value)
            hook(arguments)
        return ended


def _kind(name: str) -> str:
    """A thread's name without its number: Python numbers those that have none of their own, as "Thread-7 (handle)"."""
    head, _, function = name.partition(" (")
    return function.rstrip(")") or head.rstrip("0123456789").rstrip("-") or name
