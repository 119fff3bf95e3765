# SPDX-License-Identifier: BSD-3-Clause
"""Publishing from the loop without ever waiting for a subscriber.

rospy registers topics and handshakes with subscribers; from then on the loop thread owns the sockets. A message
is serialised once and handed to each connection with a non-blocking send. If a socket takes only a part, the rest is
kept and sent first the next time; while a rest is pending, new messages for that connection are dropped. Nothing here
imports rospy, so the sockets can be tested with plain pairs.
"""
from __future__ import annotations

import collections
import contextlib
import ctypes
import errno
import os
import socket
import struct
import time
from collections.abc import Callable, Sequence
from io import BytesIO
from typing import Any

_LENGTH = struct.Struct("<I")
_FLAGS = socket.MSG_DONTWAIT | socket.MSG_NOSIGNAL

# send(2) called without giving up the interpreter. It never blocks, and Python's own socket.send lets other threads run
# at every call: with a thread that computes and ten subscribers, a tick would wait for that thread ten times over.
_send = ctypes.PyDLL(None, use_errno=True).send
_send.argtypes = [ctypes.c_int, ctypes.c_char_p, ctypes.c_size_t, ctypes.c_int]
_send.restype = ctypes.c_ssize_t
_FULL = (errno.EAGAIN, errno.EWOULDBLOCK, errno.EINTR)

# Send buffer of a connection [bytes]. With the kernel's default, a subscriber that stopped reading would find minutes
# of old messages when it resumes. Larger messages are sent in parts, one part per tick.
SEND_BUFFER_BYTES = 128 * 1024


# A subscriber that has read nothing for this long counts as stopped [s]; then it is tried with this period [s]. Trying
# hundreds of stopped subscribers at every tick would take longer than the physics.
STOPPED_S = 0.05
STOPPED_RETRY_S = 0.05


class Peer:
    """The sending end of one subscriber's connection."""

    __slots__ = ("transport", "dropped", "_socket", "_rest", "_clock", "_full_since", "_retry_at")

    def __init__(self, transport: Any, clock: Callable[[], float] = time.perf_counter) -> None:
        """``transport``: rospy's connection object (``socket``, ``close()``, ``stat_bytes``, ``stat_num_msg``)."""
        self.transport = transport
        self.dropped = 0
        self._rest: bytes | None = None
        self._clock = clock
        self._full_since: float | None = None
        self._retry_at = 0.0
        self._socket: socket.socket | None = transport.socket
        if self._socket is not None:
            # Small messages go out at once instead of waiting for the acknowledgement of the one before.
            with contextlib.suppress(OSError):
                self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            with contextlib.suppress(OSError):
                self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER_BYTES)

    @classmethod
    def of(cls, transport: Any) -> Peer:
        """The peer of a connection. Publishers of the same topic share it, so that they do not write into each other's
        messages."""
        peer = getattr(transport, "loop_peer", None)
        if peer is None:
            peer = transport.loop_peer = cls(transport)
        return peer

    @property
    def has_rest(self) -> bool:
        """True while a part of a message is still to be sent."""
        return self._rest is not None

    def send(self, data: bytes) -> None:
        """Send the framed message ``data`` or drop it. Raises ``OSError`` when the connection is dead."""
        if self._rest is not None:
            self.flush()
            if self._rest is not None:
                self.dropped += 1
                return
        sent = self._send(data)
        if sent == 0:
            self.dropped += 1
            return
        if sent < len(data):
            self._rest = data[sent:]
        self.transport.stat_num_msg += 1

    def flush(self) -> None:
        """Send the rest of a message, as far as the socket takes it. Raises ``OSError`` when the connection is dead."""
        if self._rest is not None:
            self._rest = self._rest[self._send(self._rest):] or None

    def _send(self, data: bytes) -> int:
        if self._socket is None:
            raise OSError("connection closed")
        if self._full_since is not None and self._clock() < self._retry_at:
            return 0
        sent = _send(self._socket.fileno(), data, len(data), _FLAGS)
        if sent < 0:
            code = ctypes.get_errno()
            if code in _FULL:
                self._note_full()
                return 0
            raise OSError(code, os.strerror(code))
        self._full_since = None
        self.transport.stat_bytes += sent
        return sent

    def _note_full(self) -> None:
        now = self._clock()
        if self._full_since is None:
            self._full_since = now
            self._retry_at = 0.0
        elif now - self._full_since >= STOPPED_S:
            self._retry_at = now + STOPPED_RETRY_S


class LoopPublisher:
    """One topic, published from the loop thread.

    Before :meth:`attach` it has no listeners, and publishing only stores the latched message.
    """

    def __init__(self, hub: PublisherHub, topic: str, msg_class: type, latch: bool = False, greet: bool = False,
                 release: Callable[[], object] = lambda: None) -> None:
        """``latch`` as in ROS; ``greet`` sends the last message to late subscribers without the latched flag;
        ``release()`` ends the registration, also while it is still in progress."""
        self.topic = topic
        self.msg_class = msg_class
        self.latch = latch
        #: True while a subscriber is connected, as of the hub's last turn. After the last one has gone, it stays True
        #: until the next message. A plain attribute for speed: a robot checks a hundred topics per tick.
        self.has_listeners = False
        #: See :class:`loop_ros.protocol.Publisher`.
        self.present: Callable[[], Sequence[Any]] | None = None
        self._unserved: list[Peer] = []
        self._hub = hub
        self._keep_last = latch or greet
        self._has_header = getattr(msg_class, "_has_header", False)
        self._buffer = BytesIO()
        self._seq = 0
        self._last: bytes | None = None
        self._impl: Any = None
        self._known: list[Any] | None = None
        self._peers: list[Peer] = []
        self._release = release
        #: True once :meth:`close` was called.
        self.is_closed = False

    def attach(self, impl: Any) -> None:
        """Start to serve the ``connections`` of rospy's publisher ``impl``."""
        self._impl = impl
        self._hub.attention.append(self)

    def publish(self, message: Any) -> None:
        """Send ``message`` to all connected subscribers; very cheap when there are none."""
        impl = self._impl
        if self._keep_last or (impl is not None and impl.connections):
            self.publish_serialized(self._serialize(message))
        else:
            self.has_listeners = False

    def publish_serialized(self, data: bytes) -> None:
        """Send a message that is already framed: its length as little-endian uint32, then its bytes."""
        impl = self._impl
        if impl is not None:
            connections = impl.connections
            # Done before the latch changes: a new subscriber gets this message once, and not the previous one.
            if connections is not self._known:
                self._adopt(connections)
            dead: list[Peer] = []
            for peer in self._peers:
                try:
                    peer.send(data)
                except OSError:
                    dead.append(peer)
                    continue
                if peer.has_rest:
                    self._hub.backlog.add(self)
            if dead:
                self._bury(dead)
            if self._unserved:
                self._unserved = []
        if self._keep_last:
            self._last = data

    def greet(self) -> bool:
        """Send the last message to connections made after it. Returns True where :meth:`tell_present` is for them."""
        impl = self._impl
        if impl is None or impl.connections is self._known:
            return False
        newcomers = self._adopt(impl.connections)
        if self._last is not None:
            self._send_to(newcomers, self._last)
        elif self.present is not None:
            self._unserved += newcomers
        return bool(self._unserved)

    def tell_present(self) -> None:
        """Send the messages of ``present`` to the connections that no message has been sent to yet."""
        newcomers, self._unserved = self._unserved, []
        if self.present is None or not any(peer in self._peers for peer in newcomers):
            return
        for message in self.present():
            self._send_to([peer for peer in newcomers if peer in self._peers], self._serialize(message))

    def renew(self) -> None:
        """The state that ``present`` tells is another one: in a paused world, everybody gets it."""
        if self._peers and self.present is not None:
            self._unserved = list(self._peers)
            self._hub.unserved.add(self)

    def flush(self) -> bool:
        """Send the rests of earlier messages. Returns True while a rest is still pending."""
        dead: list[Peer] = []
        for peer in self._peers:
            try:
                peer.flush()
            except OSError:
                dead.append(peer)
        self._bury(dead)
        return any(peer.has_rest for peer in self._peers)

    def close(self) -> None:
        """Stop publishing and unregister."""
        if self.is_closed:
            return
        self.is_closed = True
        self._impl = self._known = None
        self._peers, self._unserved, self.present = [], [], None
        self.has_listeners = False
        self._hub.backlog.discard(self)
        self._hub.unserved.discard(self)
        self._release()

    def _adopt(self, connections: list[Any]) -> list[Peer]:
        """Follow rospy's list of connections (a new list at every change); return the peers that are new."""
        known = {id(peer.transport): peer for peer in self._peers}
        self._peers = [known.get(id(connection)) or Peer.of(connection) for connection in connections]
        self._known = connections
        self.has_listeners = bool(connections)
        return [peer for peer in self._peers if id(peer.transport) not in known]

    def _send_to(self, peers: list[Peer], data: bytes) -> None:
        dead: list[Peer] = []
        for peer in peers:
            try:
                peer.send(data)
            except OSError:
                dead.append(peer)
            if peer.has_rest:
                self._hub.backlog.add(self)
        self._bury(dead)

    def _bury(self, dead: list[Peer]) -> None:
        for peer in dead:
            self._peers.remove(peer)
            with contextlib.suppress(Exception):  # rospy logs errors of closing a broken connection
                peer.transport.close()

    def _serialize(self, message: Any) -> bytes:
        if self._has_header:
            self._seq += 1
            message.header.seq = self._seq
        buffer = self._buffer
        buffer.seek(4)
        message.serialize(buffer)
        end = buffer.tell()
        buffer.seek(0)
        buffer.write(_LENGTH.pack(end - 4))
        buffer.truncate(end)
        return buffer.getvalue()


class PublisherHub:
    """Serves all publishers of the loop, once per turn."""

    def __init__(self) -> None:
        """No publishers yet."""
        #: Publishers with a new connection; other threads append, the loop removes.
        self.attention: collections.deque[LoopPublisher] = collections.deque()
        #: Publishers with parts of messages still to send; loop thread only.
        self.backlog: set[LoopPublisher] = set()
        #: Publishers with subscribers that get what is published next, or the present state; loop thread only.
        self.unserved: set[LoopPublisher] = set()

    def service(self, is_paused: bool = False) -> None:
        """Send latched messages to new subscribers, and the present state in a paused world; continue messages that
        were sent in part."""
        while self.attention:
            publisher = self.attention.popleft()
            if publisher.greet():
                self.unserved.add(publisher)
        if is_paused:
            while self.unserved:
                self.unserved.pop().tell_present()
        if self.backlog:
            for publisher in list(self.backlog):
                if not publisher.flush():
                    self.backlog.discard(publisher)
