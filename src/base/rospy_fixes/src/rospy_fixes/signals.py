# SPDX-License-Identifier: BSD-3-Clause
"""Keeps Ctrl-C from stopping a program for ever in the middle of rospy's work.

rospy runs a program's shutdown handlers in its signal handler, so in the thread that the signal interrupts. Where that
thread was publishing, or calling the master, it holds a lock that is not reentrant; a handler that publishes, or the
end of the node, waits for it for ever. And a message that is written inside of another one breaks the connection.
"""
from __future__ import annotations

import functools
import sys
import threading
from collections.abc import Callable
from typing import Any

# Longest delay of a signal by a call that does not end: a master or a subscriber that has stopped [s, wall].
LONGEST_S = 1.0


class Postponement:
    """Calls of the main thread that a signal does not interrupt: its handler runs at their end."""

    def __init__(self, longest_s: float = LONGEST_S) -> None:
        self._longest_s = longest_s
        self._depth, self._pending = 0, []

    def around(self, call: Callable) -> Callable:
        """``call``, after which postponed handlers run."""
        @functools.wraps(call)
        def whole(*arguments, **options):
            if threading.get_ident() != threading.main_thread().ident:
                return call(*arguments, **options)
            self._depth += 1
            try:
                return call(*arguments, **options)
            finally:
                self._depth -= 1
                if self._pending and not self._depth:
                    self._handle()
        return whole

    def of(self, handler: Callable) -> Callable:
        """``handler`` of a signal: it runs at once, or at the end of the interrupted call. If that does not end within
        the longest delay, it runs in another thread."""
        @functools.wraps(handler)
        def handle(number, frame):
            if not self._depth:
                return handler(number, frame)
            self._pending.append(functools.partial(handler, number, frame))
            late = threading.Timer(self._longest_s, self._handle)
            late.daemon = True
            late.start()
        return handle

    def _handle(self):
        while self._pending:
            try:
                handler = self._pending.pop(0)
            except IndexError:  # another thread has just taken it
                return
            handler()


def amend(topics: Any) -> None:
    """Make rospy's handler of signals wait for messages and calls of the master that are under way in the main thread.

    ``topics``: the module rospy.topics, which has imported the other two.
    """
    core: Any
    core, registration = sys.modules["rospy.core"], sys.modules["rospy.impl.registration"]
    postponement = Postponement()
    core._ros_signal = postponement.of(core._ros_signal)
    topics.Publisher.publish = postponement.around(topics.Publisher.publish)
    request = "_ServerProxy__request"
    setattr(core._LockedServerProxy, request, postponement.around(getattr(core._LockedServerProxy, request)))
    # Held around a call of the master, at whose end a handler may make a publisher.
    registration.get_registration_listeners().lock = threading.RLock()
