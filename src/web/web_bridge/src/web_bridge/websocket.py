# SPDX-License-Identifier: BSD-3-Clause
"""Clients on tornado's WebSocket: one handler for each client, on one loop for all. No ROS.

Frames of a client are served one at a time, those that may wait for the master in a thread of the pool; the next frame
is read when the last one has been served, so that a flood of operations waits in the client's own socket. What goes to
the client waits in its OutgoingBuffer and is written by a task of its own; a client that does not read stops that task,
and nothing else.
"""
from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any, NamedTuple

from tornado import iostream, web, websocket

from web_bridge.access import Access, Rules
from web_bridge.errors import RequestForbidden
from web_bridge.outgoing import DROPPABLE_BYTES, OutgoingBuffer
from web_bridge.session import Session

if TYPE_CHECKING:
    from tornado.httputil import HTTPServerRequest

    from web_bridge.foxglove.rules import FoxgloveRules
    from web_bridge.foxglove.session import FoxgloveSession
    from web_bridge.loop_thread import LoopThread

_LOG = logging.getLogger("web_bridge")
#: Threads for operations that may wait for the master.
_THREADS = 16
#: Clients at a time; a page that opens connections without end must not use up the descriptors.
MAX_CLIENTS = 500


class SocketOptions(NamedTuple):
    """``access``: who may connect; ``rules``: what clients may name; ``delay_s`` between two frames to one client;
    ``buffer_bytes``: messages of topics that wait for one client."""

    access: Access
    rules: Rules | FoxgloveRules = Rules()
    delay_s: float = 0.0
    use_compression: bool = False
    ping_interval_s: float = 0.0
    ping_timeout_s: float = 30.0
    largest_message: int = 64 << 20
    buffer_bytes: int = DROPPABLE_BYTES


class Clients:
    """The connected clients. ``changed(list of (address, time.time() of its connection))`` is called in the loop."""

    def __init__(self, bridge: Any, loop_thread: LoopThread, options: SocketOptions,
                 changed: Callable[[Any], None] = lambda clients: None) -> None:
        self.bridge = bridge
        self.loop_thread = loop_thread
        self.options = options
        self.pool = ThreadPoolExecutor(_THREADS, thread_name_prefix="web_bridge")
        self._changed = changed
        self._open = {}

    def opened(self, socket: ClientSocket, address: str) -> None:
        self._open[socket] = (address, time.time())
        self._changed(list(self._open.values()))

    def closed(self, socket: ClientSocket) -> None:
        if self._open.pop(socket, None) is not None:
            self._changed(list(self._open.values()))

    @property
    def is_full(self) -> bool:
        return len(self._open) >= MAX_CLIENTS

    def __len__(self) -> int:
        return len(self._open)

    @property
    def need_time(self) -> bool:
        """Any thread: whether a client is connected that has not said ``time=none`` in its address."""
        return any(socket.needs_time for socket in list(self._open))

    def application(self, *routes: Any, socket: type[ClientSocket] | None = None) -> web.Application:
        """A tornado application that serves ``socket`` (a ClientSocket; None: rosbridge) at its PATHS, after further
        ``routes``.
        """
        socket = socket or RosbridgeSocket
        options = self.options
        settings: dict[str, Any] = {"websocket_max_message_size": options.largest_message}
        if options.ping_interval_s:
            settings["websocket_ping_interval"] = options.ping_interval_s
            settings["websocket_ping_timeout"] = min(options.ping_timeout_s, options.ping_interval_s)
        return web.Application([*routes, (socket.PATHS, socket, {"clients": self})],
                               log_function=lambda handler: None, **settings)

    def shut_down(self) -> None:
        """Close all connections and end the threads; not from the loop's thread."""
        self.loop_thread.run(self._close_all())
        self.pool.shutdown(wait=False)

    async def _close_all(self) -> None:
        for socket in list(self._open):
            socket.close(1001, "the server ends")


def token_of(request: HTTPServerRequest) -> str:
    """The token of a request: ?token=… or "Authorization: Bearer …"; "" where there is none."""
    given = request.query_arguments.get("token")
    if given:
        return given[0].decode("utf-8", "surrogateescape")
    kind, _, token = request.headers.get("Authorization", "").partition(" ")
    return token.strip() if kind.lower() in ("bearer", "token") else ""


class BufferedSocket(websocket.WebSocketHandler):
    """Common base of the sockets of all protocols: access control, and a task that writes what waits for the
    client.

    ``outgoing``: the client's OutgoingBuffer, None before it is open; ``may_act``: may it do more than watch?
    """

    outgoing: OutgoingBuffer | None = None
    may_act = False

    def let_in(self, access: Access, is_full: bool, most: int) -> None:
        """For ``prepare()``: answer 403 to a client that ``access`` refuses, 503 where ``most`` are connected."""
        try:
            access.check_origin(self.request.headers.get("Origin"), self.request.host)
            self.may_act = access.may_act(token_of(self.request))
        except RequestForbidden as error:
            _LOG.warning("a client at %s was refused: %s", self.request.remote_ip, error)
            self.set_status(403)
            self.finish(str(error) + "\n")
            return
        if is_full:
            self.set_status(503)
            self.finish("%d clients are connected, which is the limit\n" % most)

    def check_origin(self, origin: str) -> bool:
        # let_in() has checked it, with a reason.
        return True

    def start_writing(self, loop_thread: LoopThread, buffer_bytes: int = DROPPABLE_BYTES,
                      delay_s: float = 0.0) -> OutgoingBuffer:
        """For ``open()``: make ``outgoing``, and write what is put into it, ``delay_s`` between two frames."""
        self.set_nodelay(True)
        self._wakeup, self._written = asyncio.Event(), asyncio.Event()
        self.outgoing = OutgoingBuffer(lambda: loop_thread.soon(self._wakeup.set), buffer_bytes)
        self._writer = asyncio.ensure_future(self._write(self.outgoing, delay_s))
        return self.outgoing

    def stop_writing(self) -> None:
        """For ``on_close()``; also where the socket was never open."""
        if self.outgoing is not None:
            self.outgoing.close()
            self._written.set()

    async def _write(self, outgoing: OutgoingBuffer, delay_s: float) -> None:
        try:
            while not outgoing.closed:
                self._wakeup.clear()
                while (frames := outgoing.take()) is not None:
                    for frame in frames:
                        await self.write_message(frame, binary=isinstance(frame, bytes))
                        self._written.set()
                        if delay_s:
                            await asyncio.sleep(delay_s)
                if outgoing.overflowed:
                    self.close(1008, "answers were not read")
                    return
                await self._wakeup.wait()
        except (websocket.WebSocketClosedError, iostream.StreamClosedError):
            pass  # on_close does the rest

    async def wait_for_room(self, kept_bytes: int) -> None:
        """Wait until answers of at most ``kept_bytes`` wait for this client, or it has gone."""
        outgoing = self.outgoing
        while outgoing is not None and not outgoing.closed and outgoing.kept_bytes > kept_bytes:
            self._written.clear()
            await self._written.wait()


class ClientSocket(BufferedSocket):
    """One client of any protocol; a subclass says at which PATHS, and with which session.

    A session has ``handle(frame)``, ``is_quick(frame)``: can it be served in the loop?, ``close()``, and
    ``tell_fault(text)``: the server has failed.
    """

    PATHS = ""

    def initialize(self, clients: Clients) -> None:
        self._clients = clients
        self._session = None

    @property
    def needs_time(self) -> bool:
        """False for a client that only reads what comes, and said so."""
        return self.request.query_arguments.get("time") != [b"none"]

    def new_session(self, rules: Any, outgoing: OutgoingBuffer) -> Session | FoxgloveSession:
        """The session of a client that has been let in; in the loop, so it must not wait for the master."""
        raise NotImplementedError

    def prepare(self) -> None:
        self.let_in(self._clients.options.access, self._clients.is_full, MAX_CLIENTS)

    def get_compression_options(self) -> dict[str, Any] | None:
        return {} if self._clients.options.use_compression else None

    def open(self, *_: str) -> None:
        options = self._clients.options
        outgoing = self.start_writing(self._clients.loop_thread, options.buffer_bytes, options.delay_s)
        self._session = self.new_session(options.rules._replace(may_act=self.may_act), outgoing)
        self._clients.opened(self, self.request.remote_ip or "")

    async def on_message(self, message: str | bytes) -> None:
        session = self._session
        if session is None:
            return
        try:
            if session.is_quick(message):
                session.handle(message)
            else:
                await asyncio.get_running_loop().run_in_executor(self._clients.pool, session.handle, message)
        # A fault of ours; this client learns of it, and stays.
        except Exception:
            _LOG.exception("an operation of the client at %s failed", self.request.remote_ip)
            session.tell_fault("the server failed at this operation; its log says how")

    def on_close(self) -> None:
        self.stop_writing()
        self._clients.closed(self)
        if self._session is None:
            return
        session, self._session = self._session, None
        try:
            self._clients.pool.submit(_close, session)
        except RuntimeError:
            pass  # the server ends, and the node with it


def _close(session: Session | FoxgloveSession) -> None:
    try:
        session.close()
    # Nobody waits for this thread's result.
    except Exception:
        _LOG.exception("what a client has left behind could not be withdrawn")


class RosbridgeSocket(ClientSocket):
    """A client that speaks rosbridge."""

    PATHS = r"/(?:rosbridge)?"

    def new_session(self, rules: Rules, outgoing: OutgoingBuffer) -> Session:
        return Session(self._clients.bridge, outgoing, rules)
