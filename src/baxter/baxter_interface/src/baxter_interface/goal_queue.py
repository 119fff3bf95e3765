# SPDX-License-Identifier: BSD-3-Clause
"""The active goal of an action server, and the newest pending one. Free of ROS."""
from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any


class GoalQueue:
    """Hands goals from the server's threads to the one thread that carries them out.

    ``cancel(handle, text)`` ends a pending goal. A newer goal replaces a pending one.
    """

    def __init__(self, cancel: Callable[[Any, str], None]) -> None:
        self._cancel_goal = cancel
        self._changed = threading.Condition()
        self._waiting = self._current = None
        self._cancelled = self._is_closed = False

    def put(self, handle: Any, check: Callable[[Any], None] = lambda is_busy: None) -> None:
        """Any thread: add a goal. ``check(is_busy)`` is called first; is_busy: whether a goal is active.

        If it raises, the error is passed on, and the queue does not change.
        """
        with self._changed:
            check(self._current is not None)
            if self._waiting is not None:
                self._cancel_goal(self._waiting, "another goal came before this one was begun")
            self._waiting = handle
            self._changed.notify()

    def cancel(self, handle: Any) -> None:
        """Any thread: end a pending goal, or mark the active one as cancelled."""
        with self._changed:
            if self._waiting is not None and self._waiting == handle:
                self._waiting = None
                self._cancel_goal(handle, "cancelled before it was begun")
            elif self._current is not None and self._current == handle:
                self._cancelled = True

    def close(self) -> None:
        """Any thread: make :meth:`take` return at once."""
        with self._changed:
            self._is_closed = True
            self._changed.notify()

    def take(self, timeout_s: float) -> Any:
        """Return the pending goal, which is then active until :meth:`done`; None if none comes within [s, wall]."""
        with self._changed:
            self._changed.wait_for(lambda: self._waiting is not None or self._is_closed, timeout_s)
            self._current, self._waiting, self._cancelled = self._waiting, None, False
            return self._current

    def done(self) -> None:
        """The active goal has ended, or is about to."""
        with self._changed:
            self._current = None

    @property
    def is_cancelled(self) -> bool:
        """Whether the active goal was cancelled."""
        return self._cancelled

    @property
    def has_next(self) -> bool:
        """Whether a newer goal is pending."""
        return self._waiting is not None
