# SPDX-License-Identifier: BSD-3-Clause
"""Accepting connections and reading their handshake headers without waiting for any of them. ROS-free.

One thread serves them all: a client that sends nothing, or a byte a second, delays nobody. Each connection has a
deadline, and each address a maximum number of connections.
"""
from __future__ import annotations

import collections
import contextlib
import errno
import selectors
import socket
import struct
import time
import weakref
from collections.abc import Callable
from typing import Any

from rospy_fixes.ports import limits
from rospy_fixes.ports.event_log import EventLog
from rospy_fixes.ports.threads import SURVIVED, ThreadFaults, lasting

_LENGTH = struct.Struct("<I")
_NO_MORE_FILES = (errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM)
#: Pause of accepting after the process has run out of descriptors [s].
PAUSE_S = 0.2
#: Number of connections accepted before open ones are read again.
ACCEPTED_AT_ONCE = 32
#: What the thread does, for its errors.
PLACE = "that accepts connections"
#: TCP keep-alive: idle time [s], interval [s], number of probes.
KEEPALIVE = (60, 10, 9)


class _Pending:
    __slots__ = ("socket", "address", "deadline", "data", "wanted")

    def __init__(self, connection: socket.socket, address: tuple[str, int], deadline: float) -> None:
        self.socket = connection
        self.address = address
        self.deadline = deadline
        self.data = bytearray()
        self.wanted = _LENGTH.size

    def read(self) -> bool:
        """Read available bytes; returns whether the header is complete. Raises ``OSError`` and ``HeaderRefused``."""
        while True:
            portion = self.socket.recv(min(self.wanted - len(self.data), 65536))
            if not portion:
                raise ConnectionResetError("closed by the client")
            self.data += portion
            if len(self.data) < self.wanted:
                continue
            if self.wanted > _LENGTH.size:
                return True
            length, = _LENGTH.unpack(self.data)
            if length > limits.HEADER_BYTES:
                raise HeaderRefused("announced a handshake header of %d bytes, at most %d are taken: no ROS client"
                                    % (length, limits.HEADER_BYTES))
            self.wanted += length
            if length == 0:
                return True


class HeaderRefused(Exception):
    """A client's data is not a valid handshake header; the text says why."""


def _notice_lost_peers(connection: socket.socket) -> None:
    """Enable TCP keep-alive, as rospy does on connections that it makes."""
    with contextlib.suppress(OSError, AttributeError):
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        options = socket.TCP_KEEPIDLE, socket.TCP_KEEPINTVL, socket.TCP_KEEPCNT
        for option, value in zip(options, KEEPALIVE, strict=True):
            connection.setsockopt(socket.IPPROTO_TCP, option, value)


class HandshakeServer:
    """Serves one listening socket until :meth:`close`."""

    def __init__(self, listener: socket.socket, serve: Callable[..., Any], events: EventLog, faults: ThreadFaults,
                 clock: Callable[[], float] = time.monotonic) -> None:
        """``listener``: a listening socket, which the caller still owns. ``serve(connection, address, header)`` takes
        over a connection with its header [bytes, from the length on]; it must not wait for the client, and where it
        raises, the connection is closed. ``events``: :class:`EventLog`; ``faults``:
        :class:`rospy_fixes.ports.threads.ThreadFaults`."""
        self._listener = listener
        self._serve = serve
        self._events = events
        self._faults = faults
        self._clock = clock
        self._selector = selectors.DefaultSelector()
        self._pending = collections.OrderedDict()
        self._in_handshake = collections.Counter()
        self._open = collections.defaultdict(list)
        self._paused_until = None
        self._wake, self._waker = socket.socketpair()
        self._closing = False
        listener.setblocking(False)
        self._selector.register(self._wake, selectors.EVENT_READ)
        self._selector.register(listener, selectors.EVENT_READ)

    @property
    def pending(self) -> int:
        """Number of connections in their handshake."""
        return len(self._pending)

    def close(self) -> None:
        """Any thread: end :meth:`run`."""
        self._closing = True
        with contextlib.suppress(OSError):
            self._waker.send(b"x")

    def run(self) -> None:
        """Serve until :meth:`close`, whatever comes."""
        def serve(ends: Callable[[], bool]) -> None:
            while not ends():
                self.turn()

        try:
            lasting(self._faults, PLACE, serve)(lambda: self._closing)
        finally:
            for pending in list(self._pending.values()):
                self._drop(pending)
            self._selector.close()
            self._wake.close()
            self._waker.close()

    def turn(self, timeout_s: float | None = None) -> None:
        """Wait for data, a deadline or ``timeout_s`` [s]; then handle it."""
        ready = self._selector.select(self._timeout() if timeout_s is None else timeout_s)
        # First those with data: only silent connections may be closed to make room.
        for key, _ in ready:
            if key.data is not None:
                self._read(key.data)
        if any(key.fileobj is self._listener for key, _ in ready):
            self._accept()
        self._expire()

    def _timeout(self) -> float | None:
        deadlines = [] if self._paused_until is None else [self._paused_until]
        if self._pending:
            deadlines.append(next(iter(self._pending.values())).deadline)
        return max(0.0, min(deadlines) - self._clock()) if deadlines else None

    def _accept(self) -> None:
        for _ in range(ACCEPTED_AT_ONCE):
            try:
                connection, address = self._listener.accept()
            except (BlockingIOError, InterruptedError, ConnectionAbortedError):
                return
            except OSError as error:
                if self._closing:
                    return
                if error.errno not in _NO_MORE_FILES:
                    raise
                self._make_room(error)
                return
            self._take(connection, address)

    def _take(self, connection: socket.socket, address: tuple[str, int]) -> None:
        host = address[0]
        if self._is_full(host):
            self._events.add(("full", host), "connection from %s refused: it has %d already"
                             % (host, limits.CONNECTIONS_PER_ADDRESS))
            connection.close()
            return
        connection.setblocking(False)
        pending = _Pending(connection, address, self._clock() + limits.HANDSHAKE_S)
        self._read(pending, is_new=True)

    def _is_full(self, host: str) -> bool:
        """Counts open sockets; they are held weakly, since their new owner closes them."""
        held = self._open[host]
        if len(held) >= limits.CONNECTIONS_PER_ADDRESS:
            held[:] = [reference for reference in held if (still := reference()) is not None and still.fileno() >= 0]
        return len(held) >= limits.CONNECTIONS_PER_ADDRESS

    def _read(self, pending: _Pending, is_new: bool = False) -> None:
        """Read what has come. An error that nobody foresaw costs this connection alone."""
        try:
            self._read_or_serve(pending, is_new)
        except SURVIVED as error:
            self._faults.note(PLACE, error, "the connection from %s:%d is closed" % pending.address[:2])
            for end in (lambda: self._forget(pending), pending.socket.close):
                with contextlib.suppress(Exception):
                    end()

    def _read_or_serve(self, pending: _Pending, is_new: bool) -> None:
        """Most headers arrive together with the connection: those are never registered."""
        try:
            complete = pending.read()
        except (BlockingIOError, InterruptedError):
            if is_new:
                self._wait_for(pending)
            return
        except OSError:
            self._drop(pending)  # the client has closed it, which is not an error
            return
        except HeaderRefused as error:
            self._drop(pending)
            self._events.add(("header", pending.address[0]), "connection from %s:%d closed: it %s"
                             % (*pending.address[:2], error))
            return
        if complete:
            self._forget(pending)
            self._remember(pending)
            pending.socket.setblocking(True)
            _notice_lost_peers(pending.socket)
            self._serve(pending.socket, pending.address, bytes(pending.data))

    def _remember(self, pending: _Pending) -> None:
        held = self._open[pending.address[0]]
        if len(held) % 256 == 255:
            held[:] = [reference for reference in held if (still := reference()) is not None and still.fileno() >= 0]
        held.append(weakref.ref(pending.socket))

    def _wait_for(self, pending: _Pending) -> None:
        host = pending.address[0]
        if self._in_handshake[host] >= limits.HANDSHAKES_PER_ADDRESS:
            oldest = next(other for other in self._pending.values() if other.address[0] == host)
            self._drop(oldest)
            self._tell_idle(host)
        self._pending[id(pending)] = pending
        self._in_handshake[host] += 1
        self._selector.register(pending.socket, selectors.EVENT_READ, pending)

    def _forget(self, pending: _Pending) -> None:
        if self._pending.pop(id(pending), None) is None:
            return
        host = pending.address[0]
        self._in_handshake[host] -= 1
        if not self._in_handshake[host]:
            del self._in_handshake[host]
        self._selector.unregister(pending.socket)

    def _drop(self, pending: _Pending) -> None:
        self._forget(pending)
        pending.socket.close()

    def _expire(self) -> None:
        now = self._clock()
        if self._paused_until is not None and now >= self._paused_until:
            self._paused_until = None
            self._selector.register(self._listener, selectors.EVENT_READ)
        while self._pending:
            oldest = next(iter(self._pending.values()))
            if now < oldest.deadline:
                return
            self._drop(oldest)
            self._tell_idle(oldest.address[0])

    def _tell_idle(self, host: str) -> None:
        self._events.add(("idle", host), "connection from %s closed: no complete handshake header within %g s, or one "
                         "of more than %d without" % (host, limits.HANDSHAKE_S, limits.HANDSHAKES_PER_ADDRESS))

    def _make_room(self, error: OSError) -> None:
        """Without free descriptors the listener would be ready all the time, and accepting would always fail."""
        self._events.add("files", "no connection can be accepted: %s; those without a handshake are closed"
                         % error.strerror)
        for pending in list(self._pending.values()):
            self._drop(pending)
        self._selector.unregister(self._listener)
        self._paused_until = self._clock() + PAUSE_S
