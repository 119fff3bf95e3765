# SPDX-License-Identifier: BSD-3-Clause
"""Requests and WebSockets that tornado passes on to another HTTP server, which listens on a Unix socket. No ROS.

Who may ask is decided before a connection to the other server is made. Its answers come by HTTP/1.0, so they end with
their connection and are never in pieces.
"""
from __future__ import annotations

import asyncio
import contextlib
from typing import TYPE_CHECKING, cast
from urllib.parse import urlsplit

from tornado import httputil, iostream, web

from web_bridge import http_text

if TYPE_CHECKING:
    from tornado.http1connection import HTTP1Connection

_CHUNK = 65536
#: A request's body; the largest are recordings and notebooks [bytes].
LARGEST_BODY = 32 << 20
#: Time for the other server to begin its answer, or to read more of a body [s].
ANSWER_S = 60.0
_METHODS = ("GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS")


def is_foreign(request: httputil.HTTPServerRequest) -> bool:
    """Does a page of another origin make this request?"""
    origin = request.headers.get("Origin")
    return origin is not None and urlsplit(origin).netloc != request.host


class PlainHandler(web.RequestHandler):
    """Answers that are not kept and tell nobody of their address; refusals are plain text."""

    def set_default_headers(self) -> None:
        self.set_header("Referrer-Policy", "no-referrer")
        self.set_header("X-Content-Type-Options", "nosniff")
        self.set_header("Cache-Control", "no-store")
        self.clear_header("Server")

    def refuse(self, status: int, text: str) -> None:
        self.set_status(status)
        self.set_header("Content-Type", "text/plain; charset=utf-8")
        self.finish(text + "\n")


@web.stream_request_body
class PassingHandler(PlainHandler):
    """A request for another server. ``prepare`` of a subclass refuses it, or calls `takes_request` and `pass_to`.

    SERVER: the other server, for messages; OWN_COOKIE: name of the cookie that it neither sees nor sets.
    """

    SUPPORTED_METHODS = _METHODS
    SERVER, OWN_COOKIE = "", ""
    _streams: tuple[asyncio.StreamReader, asyncio.StreamWriter] | None = None
    _is_entered, detached = False, False

    def initialize(self) -> None:
        self.is_upgrade = http_text.is_upgrade(self.request.headers)
        length = self.request.headers.get("Content-Length", "")
        self._length = int(length) if length.isdecimal() else 0  # tornado refuses what is no number

    @property
    def _connection(self) -> HTTP1Connection:
        return cast("HTTP1Connection", self.request.connection)

    # For subclasses to replace.

    def answer_headers(self, headers: httputil.HTTPHeaders) -> list[tuple[str, str]]:
        """The (name, value) that the client gets of an answer's headers."""
        raise NotImplementedError

    def entered(self) -> None:
        """The request is passed on from here on; its body may come in slowly."""

    def left(self) -> None:
        """It is not any more; called once after `entered`."""

    def may_pass(self, chunk: bytes) -> bool:
        """Whether these bytes of a client's WebSocket are passed on."""
        return True

    # For `prepare` of subclasses.

    def takes_request(self) -> bool:
        """Whether a request of this origin, with this body, is taken; else it is refused."""
        if is_foreign(self.request):
            self.refuse(403, "a page of %s may not use this address" % self.request.headers["Origin"][:200])
        elif "Transfer-Encoding" in self.request.headers:
            self.refuse(411, "a request's body needs a length here")
        elif self._length > LARGEST_BODY:
            self.refuse(413, "a request may have %d MB, not %d" % (LARGEST_BODY >> 20, self._length >> 20))
        else:
            self._connection.set_max_body_size(LARGEST_BODY)
            return True
        return False

    async def pass_to(self, path: str, uri: str) -> None:
        """Connect to the socket ``path``, and pass the head of the request on; its body follows as it comes in."""
        self._is_entered = True
        self.entered()
        try:
            self._streams = await asyncio.open_unix_connection(str(path), limit=http_text.LARGEST_HEAD)
        except OSError as error:
            self._leave()
            self._refuse_answer(error)
            return
        self._streams[1].write(http_text.request_head(self.request.method, uri, self.request.headers, self._length,
                                                      self.is_upgrade, self.OWN_COOKIE))

    # For tornado.

    async def data_received(self, chunk: bytes) -> None:
        if self._streams is None:
            return
        # A server that does not read holds its client up, and not the memory of this one.
        try:
            self._streams[1].write(chunk)
            async with asyncio.timeout(ANSWER_S):
                await self._streams[1].drain()
        except TimeoutError:
            # Meanwhile nothing tells whether the client is still there.
            cast("iostream.IOStream", self._connection.stream).close()
        except OSError:
            pass  # what the server has answered before it went is read afterwards

    def on_connection_close(self) -> None:
        # Also of a client that goes in the middle of its request.
        super().on_connection_close()
        self._leave()

    async def _pass(self, *_: str) -> None:
        if self._streams is None:
            return  # refused already
        try:
            if self.is_upgrade:
                await self._tunnel(*self._streams)
            else:
                await self._answer(self._streams[0])
        except (OSError, EOFError, asyncio.LimitOverrunError, http_text.BadAnswer) as error:
            if not self._finished and not self._headers_written and not self.detached:
                self._refuse_answer(error)
        finally:
            self._leave()

    get = head = post = put = patch = delete = options = _pass

    def _leave(self) -> None:
        if self._streams is not None:
            self._streams[1].close()
        if self._is_entered:
            self._is_entered = False
            self.left()

    def _refuse_answer(self, error: Exception) -> None:
        self.refuse(502, "%s does not answer: %s" % (self.SERVER, error or type(error).__name__))

    async def _head(self, reader: asyncio.StreamReader) -> tuple[int, httputil.HTTPHeaders]:
        """(status, headers) of the answer."""
        async with asyncio.timeout(ANSWER_S):
            return http_text.answer_head(await reader.readuntil(b"\r\n\r\n"))

    async def _answer(self, reader: asyncio.StreamReader) -> None:
        status, headers = await self._head(reader)
        try:
            self.set_status(status)
            # The server says how long its answers may be kept.
            self.clear_header("Cache-Control")
            for name, value in self.answer_headers(headers):
                (self.add_header if name == "Set-Cookie" else self.set_header)(name, value)
            if self.request.method != "HEAD" and status not in (204, 304):
                while chunk := await reader.read(_CHUNK):
                    self.write(chunk)
                    await self.flush()
            await self.finish()
        except (iostream.StreamClosedError, httputil.HTTPOutputError):
            # The client has gone, or the answer has not the length that it announced.
            cast("iostream.IOStream", self._connection.stream).close()

    async def _tunnel(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        status, headers = await self._head(reader)
        if status != 101:
            self.refuse(403 if status == 403 else 502, "%s refused this connection (%d)" % (self.SERVER, status))
            return
        self.detached = True
        client = self.detach()
        try:
            await client.write(http_text.upgrade_text(headers))
            await self._copy_both(client, reader, writer)
        except iostream.StreamClosedError:
            pass
        finally:
            client.close()

    async def _copy_both(self, client: iostream.IOStream, reader: asyncio.StreamReader,
                         writer: asyncio.StreamWriter) -> None:
        async def to_client() -> None:
            while chunk := await reader.read(_CHUNK):
                await client.write(chunk)

        async def to_server() -> None:
            while True:
                chunk = await client.read_bytes(_CHUNK, partial=True)
                if self.may_pass(chunk):
                    writer.write(chunk)
                    await writer.drain()

        tasks = [asyncio.ensure_future(copy) for copy in (to_client(), to_server())]
        _, others = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        for task in others:
            task.cancel()
        for task in tasks:
            with contextlib.suppress(asyncio.CancelledError, iostream.StreamClosedError, OSError):
                await task
