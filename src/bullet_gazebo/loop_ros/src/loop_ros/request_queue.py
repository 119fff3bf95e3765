# SPDX-License-Identifier: BSD-3-Clause
"""Calls that other threads want made in the loop's thread. ROS-free."""
import collections
import threading
from concurrent.futures import CancelledError, Future


class RequestQueue:
    """Any thread submits a call; the loop makes it and answers with a ``Future``, one for each call."""

    def __init__(self):
        """Open, no requests."""
        self._requests = collections.deque()
        self._lock = threading.Lock()
        self._wake = threading.Event()
        self._closed = False

    def submit(self, function, *arguments):
        """Any thread: have ``function(*arguments)`` called between two ticks; returns a ``Future``."""
        future = Future()
        with self._lock:
            if self._closed:
                future.cancel()
                return future
            self._requests.append((future, function, arguments))
        self._wake.set()
        return future

    def call(self, function, *arguments):
        """Any other thread: submit and wait; returns or raises what the function does.

        Raises :class:`LoopEnded` when the loop stops before it answers.
        """
        try:
            return self.submit(function, *arguments).result()
        except CancelledError:
            raise LoopEnded("the simulator is shutting down") from None

    def run_pending(self):
        """Loop thread: answer every request that is there by now. Returns how many there were."""
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
                # A thread that gets it ends without a word, and its client waits for ever.
                future.set_exception(RuntimeError("it called sys.exit(%r)" % (error.code,)))
            except Exception as error:  # noqa: BLE001  (whatever it is, it belongs to the caller)
                future.set_exception(error)
        return count

    def wait(self, timeout_s):
        """Loop thread, while nothing moves: sleep until a request comes or the time [s] is over."""
        if self._wake.wait(timeout_s):
            self._wake.clear()

    def close(self):
        """Cancel what is pending and refuse what comes later."""
        with self._lock:
            self._closed = True
            pending, self._requests = self._requests, collections.deque()
        for future, _, _ in pending:
            future.cancel()


class LoopEnded(Exception):
    """The loop stopped before it could answer."""
