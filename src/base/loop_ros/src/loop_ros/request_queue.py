# SPDX-License-Identifier: BSD-3-Clause
"""Functions that other threads have called in the loop's thread. ROS-free."""
from __future__ import annotations

import collections
import threading
from collections.abc import Callable
from concurrent.futures import CancelledError, Future
from typing import Any

_Request = tuple['Future[Any]', Callable[..., Any], tuple[Any, ...]]


class RequestQueue:
    """Any thread submits a call and gets a ``Future``; the loop makes the call and sets the result."""

    def __init__(self) -> None:
        """Open, no requests."""
        self._requests: collections.deque[_Request] = collections.deque()
        self._lock = threading.Lock()
        self._wake = threading.Event()
        self._closed = False

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Any thread: queue a call of ``function(*arguments)`` in the loop, between two ticks; returns a ``Future``."""
        future: Future[Any] = Future()
        with self._lock:
            if self._closed:
                future.cancel()
                return future
            self._requests.append((future, function, arguments))
        self._wake.set()
        return future

    def call(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """Any other thread: submit and wait; returns the function's result or raises its error.

        Raises :class:`LoopEnded` if the loop stops first.
        """
        try:
            return self.submit(function, *arguments).result()
        except CancelledError:
            raise LoopEnded("the simulator is shutting down") from None

    def run_pending(self) -> int:
        """Loop thread: answer all pending requests. Returns how many there were."""
        if not self._requests:
            return 0
        count = len(self._requests)
        for _ in range(count):
            future, function, arguments = self._requests.popleft()
            if not future.set_running_or_notify_cancel():
                continue
            try:
                future.set_result(function(*arguments))
            except SystemExit as error:
                # If SystemExit reached the waiting thread, the thread would end silently and its client would wait for
                # ever.
                future.set_exception(RuntimeError("it called sys.exit(%r)" % (error.code,)))
            except Exception as error:  # noqa: BLE001  (every error is passed on to the caller)
                future.set_exception(error)
        return count

    def wait(self, timeout_s: float) -> None:
        """Loop thread, while the world is paused: sleep until a request comes or the time [s] is over."""
        if self._wake.wait(timeout_s):
            self._wake.clear()

    def close(self) -> None:
        """Cancel pending requests and refuse later ones."""
        with self._lock:
            self._closed = True
            pending, self._requests = self._requests, collections.deque()
        for future, _, _ in pending:
            future.cancel()


class LoopEnded(Exception):
    """The loop stopped before it could answer."""
