# SPDX-License-Identifier: BSD-3-Clause
"""How other threads reach the loop: they post, the loop takes. ROS-free.

Commands go into a :class:`Mailbox` (only the newest counts) or a :class:`Queue` (each one counts), requests into the
:class:`RequestBoard`, which answers each with a ``Future`` of its own.
"""
import collections
import threading
from concurrent.futures import CancelledError, Future

from loop_ros.faults import SURVIVED


def _raise(error):
    raise error


class _Subscription:
    """What is common to both: handing messages to code that may fail on them, and the end."""

    #: Called once, when the subscription is closed.
    on_close = None

    def guarded(self, take, *arguments):
        """Loop thread: call ``take(*arguments)`` for one message; one that it fails on is dropped and counted."""
        try:
            take(*arguments)
        except SURVIVED as error:
            self._on_fault(error)

    def close(self):
        """End it and drop what is unread."""
        ended, self.on_close = self.on_close, None
        if ended is not None:
            ended()
        self._drop()


class Mailbox(_Subscription):
    """Newest wins: a later message replaces one that was not taken yet."""

    def __init__(self, on_fault=_raise):
        """Empty. ``on_fault(error)``: told of what :meth:`handle` survives."""
        self._on_fault = on_fault
        #: Messages delivered since the start; read by the lock-step service.
        self.delivered = 0
        # A deque of one: append and pop are atomic, so no message is lost between the threads.
        self._newest = collections.deque(maxlen=1)

    def put(self, message):
        """Any thread: post a message."""
        self._newest.append(message)
        self.delivered += 1

    def take(self):
        """Loop thread: the newest message since the last call, or None."""
        return self._newest.pop() if self._newest else None

    def handle(self, take):
        """Loop thread: :meth:`guarded` for the newest message since the last call, if there is one."""
        if self._newest:
            self.guarded(take, self._newest.pop())

    def _drop(self):
        self._newest.clear()


class Queue(_Subscription):
    """Each message counts: oldest first, up to ``depth`` unread ones; beyond that the oldest are lost and counted."""

    def __init__(self, depth, notice=lambda: None, on_fault=_raise):
        """``depth``: how many unread messages are kept; ``notice()`` is called when one has come in; ``on_fault``: as
        for :class:`Mailbox`."""
        if depth < 1:
            raise ValueError("queue depth is %r, expected at least 1" % (depth,))
        self.delivered = 0
        self.lost = 0
        self._notice = notice
        self._on_fault = on_fault
        self._messages = collections.deque(maxlen=depth)

    def put(self, message):
        """Any thread: post a message."""
        if len(self._messages) == self._messages.maxlen:
            self.lost += 1
        self._messages.append(message)
        # Before it counts as delivered: a lock-step request that waited for it goes on from there.
        self._notice()
        self.delivered += 1

    def drain(self):
        """Loop thread: all unread messages, oldest first."""
        if not self._messages:
            return []  # a robot looks into a hundred queues each tick, and nearly all are empty
        messages = []
        while self._messages:
            messages.append(self._messages.popleft())
        return messages

    def handle(self, take):
        """Loop thread: :meth:`guarded` for each unread message, oldest first."""
        for message in self.drain():
            self.guarded(take, message)

    def _drop(self):
        self._messages.clear()


class RequestBoard:
    """Calls that other threads want made in the loop thread."""

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
            except Exception as error:  # noqa: BLE001  (whatever it is, it belongs to the one who asked)
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
