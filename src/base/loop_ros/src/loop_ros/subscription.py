# SPDX-License-Identifier: BSD-3-Clause
"""The queue of a topic's unread messages. ROS-free."""
from __future__ import annotations

import collections
from collections.abc import Callable
from typing import Any, NoReturn

from loop_ros.faults import SURVIVED


def _raise(error: BaseException) -> NoReturn:
    raise error


class MessageQueue:
    """Unread messages of a topic: any thread puts them in, the loop takes them out.

    Keeps the newest ``depth`` messages.
    """

    #: Called once, when the subscription is closed.
    on_close: Callable[[], object] | None = None

    def __init__(self, depth: int = 1, notice: Callable[[], object] = lambda: None,
                 on_fault: Callable[[Exception | SystemExit], object] = _raise) -> None:
        """``notice()`` is called for each new message, in the thread that puts it in; ``on_fault(error)`` for
        each that :meth:`guarded` drops. Raises ValueError for a depth below 1."""
        if depth < 1:
            raise ValueError("the depth of a subscription is %r, expected at least 1" % (depth,))
        #: How many publishers are connected; 1 where nobody counts them.
        self.senders: Callable[[], int] = lambda: 1
        #: Messages since the start; read by the lock-step service.
        self.delivered = 0
        self._notice = notice
        self._on_fault = on_fault
        # Append and pop of a deque are atomic: no message is lost between the threads.
        self._unread: collections.deque[Any] = collections.deque(maxlen=depth)

    def put(self, message: Any) -> None:
        """Any thread: add a message; beyond the depth, the oldest is dropped."""
        self._unread.append(message)
        # Called before the message counts as delivered: the count lets a waiting lock-step request proceed.
        self._notice()
        self.delivered += 1

    def take(self) -> Any:
        """Loop thread: the newest unread message, or None; older ones are dropped."""
        messages = self.drain()
        return messages[-1] if messages else None

    def drain(self) -> list[Any]:
        """Loop thread: all unread messages, oldest first."""
        if not self._unread:
            return []  # nearly always, and a robot has a hundred subscriptions
        messages = []
        while self._unread:
            messages.append(self._unread.popleft())
        return messages

    def handle(self, handler: Callable[[Any], Any]) -> None:
        """Loop thread: :meth:`guarded` for each unread message, oldest first."""
        for message in self.drain():
            self.guarded(handler, message)

    def guarded(self, handler: Callable[..., Any], *arguments: Any) -> None:
        """Loop thread: call ``handler(*arguments)`` for one message; an error is counted and not passed on."""
        try:
            handler(*arguments)
        except SURVIVED as error:
            self._on_fault(error)

    def close(self) -> None:
        """End the subscription and drop what is unread."""
        ended, self.on_close = self.on_close, None
        if ended is not None:
            ended()
        self._unread.clear()
