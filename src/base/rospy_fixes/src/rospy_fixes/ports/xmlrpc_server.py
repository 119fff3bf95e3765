# SPDX-License-Identifier: BSD-3-Clause
"""A node's XML-RPC server with a deadline for each connection and a maximum number for each address."""
from __future__ import annotations

import collections
import contextlib
import errno
import socket
import threading
import time
from collections.abc import Callable
from typing import Any

import rosgraph.xmlrpc

from rospy_fixes.ports import limits
from rospy_fixes.ports.event_log import EventLog
from rospy_fixes.ports.shared import EVENTS, FAULTS
from rospy_fixes.ports.threads import ThreadFaults, lasting

_NO_MORE_FILES = (errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM)
#: Sleep of the server after it has run out of descriptors [s]; otherwise it would loop at full speed.
PAUSE_S = 0.2


class Connections:
    """The open connections of a server, each with the time at which it is closed. Any thread.

    An idle connection is only shut down: the thread that waits for it closes it.
    """

    def __init__(self, events: EventLog, clock: Callable[[], float] = time.monotonic) -> None:
        """``events``: :class:`rospy_fixes.ports.event_log.EventLog`."""
        self._events = events
        self._clock = clock
        self._lock = threading.Lock()
        self._deadlines = collections.OrderedDict()  # {socket: (address, deadline, quiet)}, the longest unchanged first

    def add(self, connection: socket.socket, host: str) -> None:
        """Add a connection of address ``host``. If there are too many, the longest idle one is closed."""
        with self._lock:
            of_host = [other for other, (its_host, *_) in self._deadlines.items() if its_host == host]
            if len(of_host) >= limits.XMLRPC_PER_ADDRESS:
                self._end(of_host[0], host, "one of more than %d" % limits.XMLRPC_PER_ADDRESS)
            self._deadlines[connection] = host, self._clock() + limits.XMLRPC_FIRST_S, False

    def allow(self, connection: socket.socket, time_s: float, quiet: bool = False) -> None:
        """The connection was active: keep it open for another ``time_s`` [s]. ``quiet``: its end then is no event."""
        with self._lock:
            if connection in self._deadlines:
                host, *_ = self._deadlines.pop(connection)
                self._deadlines[connection] = host, self._clock() + time_s, quiet

    def remove(self, connection: socket.socket) -> None:
        """The connection is closed."""
        with self._lock:
            self._deadlines.pop(connection, None)

    def expire(self) -> None:
        """Close the expired ones."""
        now = self._clock()
        with self._lock:
            for connection, (host, deadline, quiet) in list(self._deadlines.items()):
                if now >= deadline:
                    self._end(connection, host, "" if quiet else "no request came in time")

    def make_room(self, reason: str) -> None:
        """Close the quarter that was idle longest."""
        self._events.add("xmlrpc files", "no XML-RPC connection can be accepted: %s; those that have waited longest "
                         "are closed" % reason)
        with self._lock:
            for connection, (host, *_) in list(self._deadlines.items())[:1 + len(self._deadlines) // 4]:
                self._end(connection, host, "no room")

    def _end(self, connection: socket.socket, host: str, why: str) -> None:
        del self._deadlines[connection]
        with contextlib.suppress(OSError):
            connection.shutdown(socket.SHUT_RDWR)
        if why:
            self._events.add(("xmlrpc", host), "XML-RPC connection from %s closed: %s" % (host, why))


class _RequestHandler(rosgraph.xmlrpc.SilenceableXMLRPCRequestHandler):
    def do_POST(self) -> None:
        connections = self.server.connections
        connections.allow(self.connection, limits.XMLRPC_REQUEST_S)
        try:
            length = int(self.headers.get("Content-Length", ""))
        except ValueError:
            length = -1
        if not 0 <= length <= limits.MESSAGE_BYTES:
            # The rest is not read, so no later request can be read.
            self.close_connection = True
            self.send_error(413 if length >= 0 else 411, explain="Content-Length is %r, expected 0 to %d bytes"
                            % (self.headers.get("Content-Length"), limits.MESSAGE_BYTES))
            return
        super().do_POST()
        # rospy's clients keep a connection after its last request.
        connections.allow(self.connection, limits.XMLRPC_IDLE_S, quiet=True)


def limited_server(events: EventLog, faults: ThreadFaults) -> type:
    """The replacement of the class ``rosgraph.xmlrpc.ThreadingXMLRPCServer``."""

    class LimitedXMLRPCServer(rosgraph.xmlrpc.ThreadingXMLRPCServer):
        def __init__(self, addr: Any, log_requests: int = 1) -> None:
            self.connections = Connections(events)
            super().__init__(addr, log_requests)
            self.RequestHandlerClass = _RequestHandler

        def serve_forever(self, poll_interval: float = 0.5) -> None:
            # A socket that is closed serves nobody any more.
            lasting(faults, "of the XML-RPC server", lambda _: super(LimitedXMLRPCServer, self).serve_forever(
                poll_interval))(lambda: self.socket.fileno() < 0)

        def get_request(self) -> Any:
            try:
                return super().get_request()
            except OSError as error:
                if error.errno in _NO_MORE_FILES:
                    self.connections.make_room(str(error.strerror))
                    time.sleep(PAUSE_S)
                raise

        def process_request(self, request: Any, client_address: Any) -> None:
            self.connections.add(request, client_address[0])
            super().process_request(request, client_address)

        def shutdown_request(self, request: Any) -> None:
            self.connections.remove(request)
            super().shutdown_request(request)

        def service_actions(self) -> None:
            super().service_actions()
            self.connections.expire()

    return LimitedXMLRPCServer


def amend(xmlrpc: Any) -> None:
    """Give the nodes of rosgraph.xmlrpc the limited server."""
    xmlrpc.ThreadingXMLRPCServer = limited_server(EVENTS, FAULTS)
