# SPDX-License-Identifier: BSD-3-Clause
"""Accepting connections and reading their handshake headers without waiting for any of them. ROS-free.

One thread serves them all: a client that sends nothing, or a byte a second, holds up nobody. Each has a deadline, and
each address a number of connections.
"""
import collections
import contextlib
import errno
import selectors
import socket
import struct
import time
import weakref

from rospy_limits import limits

_LENGTH = struct.Struct("<I")
_NO_MORE_FILES = (errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM)
#: How long nothing is accepted after the process has run out of descriptors [s].
PAUSE_S = 0.2
#: Connections that are accepted before those that are open already are read again.
ACCEPTED_AT_ONCE = 32
#: An open connection on which nothing comes is asked after this long [s], then every so many [s], so many times.
KEEPALIVE = (60, 10, 9)


class _Pending:
    __slots__ = ("socket", "address", "deadline", "data", "wanted")

    def __init__(self, connection, address, deadline):
        self.socket = connection
        self.address = address
        self.deadline = deadline
        self.data = bytearray()
        self.wanted = _LENGTH.size

    def read(self):
        """Take what is there; returns whether the header is complete. Raises ``OSError`` and ``HeaderRefused``."""
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
    """What a client sent can be no handshake header; the text says why."""


def _notice_lost_peers(connection):
    """Have the kernel ask whether the other machine still is there, as rospy does where it is the one that connects."""
    with contextlib.suppress(OSError, AttributeError):
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        options = socket.TCP_KEEPIDLE, socket.TCP_KEEPINTVL, socket.TCP_KEEPCNT
        for option, value in zip(options, KEEPALIVE, strict=True):
            connection.setsockopt(socket.IPPROTO_TCP, option, value)


class HandshakeServer:
    """Serves one listening socket until :meth:`close`."""

    def __init__(self, listener, serve, events, clock=time.monotonic):
        """``listener``: a listening socket, which stays the caller's. ``serve(connection, address, header)`` takes over
        a connection with its header [bytes, from the length on]; it must not wait for the client. ``events``:
        :class:`EventLog`."""
        self._listener = listener
        self._serve = serve
        self._events = events
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
    def pending(self):
        """How many connections are in their handshake."""
        return len(self._pending)

    def close(self):
        """Any thread: end :meth:`run`."""
        self._closing = True
        with contextlib.suppress(OSError):
            self._waker.send(b"x")

    def run(self):
        """Serve until :meth:`close`."""
        try:
            while not self._closing:
                self.turn()
        finally:
            for pending in list(self._pending.values()):
                self._drop(pending)
            self._selector.close()
            self._wake.close()
            self._waker.close()

    def turn(self, timeout_s=None):
        """Wait until something comes in, a deadline has passed, or ``timeout_s`` [s]; and do what is to be done."""
        ready = self._selector.select(self._timeout() if timeout_s is None else timeout_s)
        # First those that have sent something: connections closed to make room for others have not.
        for key, _ in ready:
            if key.data is not None:
                self._read(key.data)
        if any(key.fileobj is self._listener for key, _ in ready):
            self._accept()
        self._expire()

    def _timeout(self):
        deadlines = [] if self._paused_until is None else [self._paused_until]
        if self._pending:
            deadlines.append(next(iter(self._pending.values())).deadline)
        return max(0.0, min(deadlines) - self._clock()) if deadlines else None

    def _accept(self):
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

    def _take(self, connection, address):
        host = address[0]
        if self._is_full(host):
            self._events.add(("full", host), "connection from %s refused: it has %d already"
                             % (host, limits.CONNECTIONS_PER_ADDRESS))
            connection.close()
            return
        connection.setblocking(False)
        pending = _Pending(connection, address, self._clock() + limits.HANDSHAKE_S)
        self._read(pending, is_new=True)

    def _is_full(self, host):
        """Counts what is open; sockets are held weakly, their new owner closes them."""
        held = self._open[host]
        if len(held) >= limits.CONNECTIONS_PER_ADDRESS:
            held[:] = [reference for reference in held if (still := reference()) is not None and still.fileno() >= 0]
        return len(held) >= limits.CONNECTIONS_PER_ADDRESS

    def _read(self, pending, is_new=False):
        """Most headers are there with their connection: those are never registered."""
        try:
            complete = pending.read()
        except (BlockingIOError, InterruptedError):
            if is_new:
                self._wait_for(pending)
            return
        except OSError:
            self._drop(pending)  # dropped by the client, which is its right
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

    def _remember(self, pending):
        held = self._open[pending.address[0]]
        if len(held) % 256 == 255:
            held[:] = [reference for reference in held if (still := reference()) is not None and still.fileno() >= 0]
        held.append(weakref.ref(pending.socket))

    def _wait_for(self, pending):
        host = pending.address[0]
        if self._in_handshake[host] >= limits.HANDSHAKES_PER_ADDRESS:
            oldest = next(other for other in self._pending.values() if other.address[0] == host)
            self._drop(oldest)
            self._tell_idle(host)
        self._pending[id(pending)] = pending
        self._in_handshake[host] += 1
        self._selector.register(pending.socket, selectors.EVENT_READ, pending)

    def _forget(self, pending):
        if self._pending.pop(id(pending), None) is None:
            return
        host = pending.address[0]
        self._in_handshake[host] -= 1
        if not self._in_handshake[host]:
            del self._in_handshake[host]
        self._selector.unregister(pending.socket)

    def _drop(self, pending):
        self._forget(pending)
        pending.socket.close()

    def _expire(self):
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

    def _tell_idle(self, host):
        self._events.add(("idle", host), "connection from %s closed: no complete handshake header within %g s, or one "
                         "of more than %d without" % (host, limits.HANDSHAKE_S, limits.HANDSHAKES_PER_ADDRESS))

    def _make_room(self, error):
        """Without descriptors the listener would be ready all the time, and nothing could be done about it."""
        self._events.add("files", "no connection can be accepted: %s; those without a handshake are closed"
                         % error.strerror)
        for pending in list(self._pending.values()):
            self._drop(pending)
        self._selector.unregister(self._listener)
        self._paused_until = self._clock() + PAUSE_S
