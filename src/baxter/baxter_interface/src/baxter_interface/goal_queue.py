# SPDX-License-Identifier: BSD-3-Clause
"""The goal that an action server works at, and the newest one that waits for its turn. Free of ROS."""
import threading


class GoalQueue:
    """Hands goals from the server's threads to the one thread that carries them out.

    ``cancel(handle, text)`` ends a goal that was not begun. A newer goal takes the place of one that waits.
    """

    def __init__(self, cancel):
        self._cancel_goal = cancel
        self._changed = threading.Condition()
        self._waiting = self._current = None
        self._cancelled = self._is_closed = False

    def put(self, handle, check=lambda is_busy: None):
        """Any thread: have a goal wait. ``check(is_busy)`` goes first, told whether a goal is at work.

        What it raises is passed on, and the queue is as it was.
        """
        with self._changed:
            check(self._current is not None)
            if self._waiting is not None:
                self._cancel_goal(self._waiting, "another goal came before this one was begun")
            self._waiting = handle
            self._changed.notify()

    def cancel(self, handle):
        """Any thread: end a goal that waits; note that the one at work is to end."""
        with self._changed:
            if self._waiting is not None and self._waiting == handle:
                self._waiting = None
                self._cancel_goal(handle, "cancelled before it was begun")
            elif self._current is not None and self._current == handle:
                self._cancelled = True

    def close(self):
        """Any thread: no longer have :meth:`take` wait."""
        with self._changed:
            self._is_closed = True
            self._changed.notify()

    def take(self, timeout_s):
        """Return the goal that waits, which is then at work until :meth:`done`; None if none comes within [s, wall]."""
        with self._changed:
            self._changed.wait_for(lambda: self._waiting is not None or self._is_closed, timeout_s)
            self._current, self._waiting, self._cancelled = self._waiting, None, False
            return self._current

    def done(self):
        """The goal at work has ended, or is about to."""
        with self._changed:
            self._current = None

    @property
    def is_cancelled(self):
        """Whether the goal at work is to end by request."""
        return self._cancelled

    @property
    def has_next(self):
        """Whether a newer goal waits."""
        return self._waiting is not None
