# SPDX-License-Identifier: BSD-3-Clause
"""A tornado application on a port, in a LoopThread. No ROS."""
from __future__ import annotations

import errno
import socket
import ssl
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

from tornado import httpserver, netutil

from rospy_fixes.hidden_tokens import hide_in_logs

if TYPE_CHECKING:
    from tornado.http1connection import HTTP1ServerConnection
    from tornado.iostream import IOStream
    from tornado.web import Application

    from web_bridge.loop_thread import LoopThread
    from web_bridge.parameters import Endpoint

#: Connections that are no WebSocket: streams of cameras, files, clients that have not asked for anything yet. They need
#: no token, so their number and their memory are limited.
MAX_CONNECTIONS = 700
#: A request's body; no server here expects any [bytes].
LARGEST_BODY = 64 << 10
#: A connection without a complete request is closed after this time [s].
IDLE_S = 30.0


def tls_context(certfile: str, keyfile: str) -> ssl.SSLContext:
    """The TLS of a server; raises OSError and ssl.SSLError for files that do not fit."""
    context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
    context.load_cert_chain(certfile, keyfile or None)
    return context


def listen(loop_thread: LoopThread, application: Application, endpoint: Endpoint, wait: Callable[[float], bool],
           complain: Callable[[str], None]) -> Serving | None:
    """A Serving at an Endpoint; where the port is taken, ``complain(text)``, and again after ``wait(seconds)``, until
    that returns False: then None. Raises OSError and ssl.SSLError for the files of TLS.
    """
    tls = tls_context(*endpoint.tls) if endpoint.tls else None
    while True:
        try:
            return Serving(loop_thread, application, endpoint.port, endpoint.address, tls)
        except OSError as error:
            complain("port %d of '%s' cannot be opened: %s; trying again in %g s"
                     % (endpoint.port, endpoint.address, error, endpoint.retry_s))
            if not wait(endpoint.retry_s):
                return None


def first_sockets(ports: Iterable[int], address: str) -> list[socket.socket]:
    """Sockets that listen on the first port that is free: nobody else can take it meanwhile. Raises OSError."""
    error = OSError(errno.EADDRINUSE, "no port was named")
    for port in ports:
        try:
            return netutil.bind_sockets(port, address)
        except OSError as taken:
            error = taken
    raise error


def port_of(sockets: list[socket.socket]) -> int:
    """The port of sockets, where the kernel chose it."""
    return sockets[0].getsockname()[1]


class LimitedServer(httpserver.HTTPServer):
    """Beyond MAX_CONNECTIONS a new one closes the oldest: without descriptors, tornado's loop would try to accept
    without a pause, and connections that say nothing must not keep others out.
    """

    def initialize(self, *args: Any, **kwargs: Any) -> None:
        super().initialize(*args, **kwargs)
        hide_in_logs()
        self._streams = {}  # the oldest first

    def handle_stream(self, stream: IOStream, address: tuple[str, int]) -> None:
        if len(self._streams) >= MAX_CONNECTIONS:
            oldest = next(iter(self._streams))
            del self._streams[oldest]
            oldest.close()
        self._streams[stream] = True
        super().handle_stream(stream, address)

    def on_close(self, server_conn: HTTP1ServerConnection) -> None:
        # Also when the connection has become a WebSocket, or a stream of images.
        self._streams.pop(server_conn.stream, None)
        super().on_close(server_conn)


class Serving:
    """Listens from the constructor on; raises OSError where the port is taken. ``address``: "" is every network.
    ``idle_s``: time for a client's request [s]; ``sockets``: those that listen already.
    """

    def __init__(self, loop_thread: LoopThread, application: Application, port: int, address: str,
                 tls: ssl.SSLContext | None = None, idle_s: float = IDLE_S,
                 sockets: list[socket.socket] | None = None) -> None:
        self._loop_thread = loop_thread
        self._sockets = netutil.bind_sockets(port, address) if sockets is None else sockets
        loop_thread.run(self._start(application, tls, idle_s))

    async def _start(self, application: Application, tls: ssl.SSLContext | None, idle_s: float) -> None:
        self._server = LimitedServer(application, ssl_options=tls, idle_connection_timeout=idle_s, body_timeout=idle_s,
                                      max_body_size=LARGEST_BODY)
        self._server.add_sockets(self._sockets)

    @property
    def port(self) -> int:
        """The first port."""
        return port_of(self._sockets)

    def url(self, endpoint: Endpoint) -> str:
        """The address for a log."""
        return "%s://%s:%d" % ("wss" if endpoint.tls else "ws", endpoint.address or "0.0.0.0", self.port)

    def close(self) -> None:
        self._loop_thread.run(self._stop())

    async def _stop(self) -> None:
        self._server.stop()
        await self._server.close_all_connections()
