# SPDX-License-Identifier: BSD-3-Clause
"""Read the connections of subscriptions in the loop, between two ticks.

rospy connects and handshakes; from then on the loop reads the sockets itself. rospy's own thread per connection would
take the interpreter lock from the loop twice per message (docs/decisions/0006). Nothing here imports rospy, so that it
can be tested with plain pairs of sockets.
"""
from __future__ import annotations

import collections
import ctypes
import errno
import os
import select
import socket
import struct
import threading
import time
from collections.abc import Callable
from typing import Any

from rospy_fixes.ports.limits import size_fault

_LENGTH = struct.Struct("<I")
# Smallest and largest portion of one read [bytes]: a few commands; for a larger message, its missing part.
PORTION_BYTES = 4096
LARGEST_PORTION_BYTES = 256 * 1024
# Receive buffer of a connection [bytes]: a publisher that sends faster than the loop reads is held up, so that its
# commands are not executed seconds late.
RECEIVE_BUFFER_BYTES = 128 * 1024
# Time limit of reading in one turn [s], when a connection holds more than one portion.
BUDGET_S = 0.001
# Shortest time between two polls of the sockets [s]. As fast as possible, a turn takes less than this, and a poll takes
# 4 us.
LOOK_PERIOD_S = 0.0005


class _PollEntry(ctypes.Structure):
    """struct pollfd of poll(2)."""

    _fields_ = (("fd", ctypes.c_int), ("events", ctypes.c_short), ("revents", ctypes.c_short))


# Called without releasing the interpreter lock, as in `loop_ros.publisher`: neither call blocks.
_libc = ctypes.PyDLL(None, use_errno=True)
_recv, _poll = _libc.recv, _libc.poll
_recv.argtypes = [ctypes.c_int, ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int]
_recv.restype = ctypes.c_ssize_t
_poll.argtypes = [ctypes.POINTER(_PollEntry), ctypes.c_ulong, ctypes.c_int]
_poll.restype = ctypes.c_int
_EMPTY = (errno.EAGAIN, errno.EWOULDBLOCK, errno.EINTR)


class PublisherConnection:
    """The receiving end of one publisher's connection. The loop reads; any thread may wait for ``ended``."""

    def __init__(self, connected: socket.socket, deliver: Callable[[bytes], object], largest_bytes: int,
                 held: bytes = b"") -> None:
        """``connected``: a connected stream socket. A duplicate of it is read, because rospy may close it at any time.
        ``deliver(data)`` takes the bytes of each message, in the loop. A message longer than ``largest_bytes`` ends the
        connection. ``held``: bytes that were read already and are not delivered yet."""
        self._socket = connected.dup()
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)
        self._deliver = deliver
        self._largest_bytes = largest_bytes
        self._held = bytearray(held)
        #: Set when the connection has ended.
        self.ended = threading.Event()
        #: Reason of the end; "" if the publisher simply closed the connection.
        self.fault = ""

    def fileno(self) -> int:
        """The file descriptor; -1 when the connection has ended."""
        return self._socket.fileno()

    def read(self, buffer: ctypes.Array[ctypes.c_char]) -> bool:
        """Read one portion and deliver the complete messages; returns whether there may be more.

        ``buffer``: a ctypes array to read into, of LARGEST_PORTION_BYTES.
        """
        portion = self._portion()
        count = _recv(self._socket.fileno(), buffer, portion, socket.MSG_DONTWAIT)
        if count < 0 and ctypes.get_errno() in _EMPTY:
            return False
        if count <= 0:
            self.end("" if count == 0 else os.strerror(ctypes.get_errno()))
            return False
        self._held += memoryview(buffer)[:count]
        self.deliver_complete()
        return count == portion and not self.ended.is_set()

    def deliver_complete(self) -> None:
        """Deliver the complete messages, in the loop. ``read`` calls it; it is also called once before the first
        read."""
        held, start = self._held, 0
        while len(held) - start >= _LENGTH.size:
            length, = _LENGTH.unpack_from(held, start)
            if length > self._largest_bytes:
                self.end(size_fault(length, self._largest_bytes))
                return
            end = start + _LENGTH.size + length
            if end > len(held):
                break
            self._deliver(bytes(held[start + _LENGTH.size:end]))
            start = end
        del held[:start]

    def end(self, fault: str = "") -> None:
        """Stop reading, in the loop or when the loop has ended."""
        self.fault = fault
        self._socket.close()
        self.ended.set()

    def _portion(self) -> int:
        missing = 0
        if len(self._held) >= _LENGTH.size:
            missing = _LENGTH.unpack_from(self._held)[0] + _LENGTH.size - len(self._held)
        return min(max(missing, PORTION_BYTES), LARGEST_PORTION_BYTES)


class SubscriberHub:
    """Reads all connections of the loop's subscriptions, once per turn.

    ``reads``: how often it was asked to. It counts also where it left the sockets alone because the last look was too
    near: what follows from the number must not depend on the wall clock.
    """

    def __init__(self, clock: Callable[[], float] = time.perf_counter) -> None:
        """No connections yet. ``clock`` is replaceable for tests."""
        self.reads = 0
        self._clock = clock
        self._new: collections.deque[PublisherConnection] = collections.deque()
        self._closed = False
        self._connections: list[PublisherConnection] = []
        self._entries: Any = ()  # a ctypes array of _PollEntry, one for each connection
        self._looked_at = -LOOK_PERIOD_S
        self._buffer = (ctypes.c_char * LARGEST_PORTION_BYTES)()

    def add(self, connection: PublisherConnection) -> None:
        """Any thread: add a :class:`PublisherConnection`, to be read from the next turn on."""
        self._new.append(connection)
        if self._closed:
            connection.end()

    def service(self) -> None:
        """Loop thread: deliver the messages that have arrived. Never waits."""
        self.reads += 1
        if self._new:
            self._take_new()
        now = self._clock()
        if now - self._looked_at < LOOK_PERIOD_S:
            return
        self._looked_at = now
        if not self._connections or _poll(self._entries, len(self._connections), 0) <= 0:
            return
        ready = [connection for connection, entry in zip(self._connections, self._entries, strict=True)
                 if entry.revents]
        more = ready
        while more:
            more = [connection for connection in more if _survive(connection, connection.read, self._buffer)]
            if self._clock() - now >= BUDGET_S:
                break
        if any(connection.ended.is_set() for connection in ready):
            self._follow([connection for connection in self._connections if not connection.ended.is_set()])

    def close(self) -> None:
        """Call when the loop has ended: end all connections."""
        self._closed = True
        self._take_new()
        for connection in self._connections:
            connection.end()
        self._follow([])

    def _take_new(self) -> None:
        connections = self._connections
        while self._new:
            connection = self._new.popleft()
            _survive(connection, connection.deliver_complete)
            if not connection.ended.is_set():
                connections = [*connections, connection]
        self._follow(connections)

    def _follow(self, connections: list[PublisherConnection]) -> None:
        self._connections = connections
        self._entries = (_PollEntry * len(connections))(
            *(_PollEntry(connection.fileno(), select.POLLIN, 0) for connection in connections))


def _survive(connection: PublisherConnection, function: Callable[..., Any], *arguments: Any) -> Any:
    """The result of ``function(*arguments)``. An error that nobody foresaw, such as no memory for a message, ends this
    connection: those behind it must be read."""
    try:
        return function(*arguments)
    except Exception as error:  # noqa: BLE001
        connection.end("%s: %s" % (type(error).__name__, error))
        return False
