# SPDX-License-Identifier: BSD-3-Clause
"""Cameras over HTTP, by the addresses of web_video_server: /, /stream, /stream_viewer and /snapshot. No ROS.

A stream is one answer that never ends, with a JPEG or PNG for each image. Its connection holds the image that is being
written and the newest one after it: a client that reads slowly sees fewer images, and none of them late.
"""
from __future__ import annotations

import asyncio
import contextlib
import logging
import socket
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple, cast

from tornado import iostream, web

from web_bridge import video_pages
from web_bridge.access import Access, host_of, origin_of
from web_bridge.cameras import COMPRESSED, IMAGE
from web_bridge.errors import BridgeError, NoSuchTopic, RequestForbidden, shown
from web_bridge.pictures import JPEG_QUALITY, PNG_COMPRESSION, ImageForm
from web_bridge.websocket import MAX_CLIENTS, token_of

if TYPE_CHECKING:
    from genpy import Message
    from tornado.httputil import HTTPServerRequest

    from web_bridge.cameras import Cameras
    from web_bridge.pictures import EncodedImage

_LOG = logging.getLogger("web_bridge")
BOUNDARY = "boundarydonotcross"
#: A client waits this long for a snapshot [s].
SNAPSHOT_S = 10.0
#: Bytes of one connection that the kernel keeps for the network; what it keeps is late.
_UNSENT_BYTES = 128 << 10
_LARGEST_SIDE = 4096
#: What all streams together hold for clients that have not read it yet [bytes].
MAX_HELD_BYTES = 256 << 20
_ENCODED_ELSEWHERE = ("vp8", "vp9", "h264")
#: Type of a stream -> what its images are encoded as; quality where none is given, and the largest.
_TYPES = {"mjpeg": ("jpeg", JPEG_QUALITY, 100), "png": ("png", PNG_COMPRESSION, 9),
          "ros_compressed": ("jpeg", JPEG_QUALITY, 100)}
_NOT_KEPT = {"Server": "web_video_server", "Pragma": "no-cache", "Referrer-Policy": "same-origin",
             "Cache-Control": "no-cache, no-store, must-revalidate, pre-check=0, post-check=0, max-age=0",
             "X-Content-Type-Options": "nosniff"}


class QueryError(BridgeError):
    """A query that cannot be served; ``status`` of HTTP."""

    def __init__(self, status: int, text: str) -> None:
        super().__init__(text)
        self.status = status


class VideoOptions(NamedTuple):
    """``access``: who may look; ``repeat_s``: a stream's last image is sent again where none came for so long (0:
    never); ``told(text)``: each request, for the log.
    """

    access: Access
    default_type: str = "mjpeg"
    repeat_s: float = 0.0
    told: Callable[[str], None] = _LOG.debug
    snapshot_s: float = SNAPSHOT_S


class VideoQuery(NamedTuple):
    """The query of a client. ``transport`` raw: the topic itself; compressed: the images of ``TOPIC/compressed``;
    original: these without a change, or the topic's own in ``form`` where there are none.
    """

    topic: str
    form: ImageForm
    transport: str = "raw"


def check_type(name: str) -> None:
    """Raise QueryError unless this is a type of stream that is served."""
    if name in _ENCODED_ELSEWHERE:
        raise QueryError(501, "type=%s needs a video encoder, which this server does not have; mjpeg, png and "
                              "ros_compressed are served" % name)
    if name not in _TYPES:
        raise QueryError(404, "type=%s is not known; mjpeg, png and ros_compressed are served" % name)


def read_query(get: Callable[[str], Any], default_type: str = "mjpeg") -> VideoQuery:
    """The VideoQuery in the arguments of an address; ``get(name)`` returns the last of a name, or None. Raises
    QueryError.
    """
    name = get("type") or default_type
    check_type(name)
    topic, transport = get("topic"), get("default_transport") or "raw"
    if not topic:
        raise QueryError(400, "no topic is given; the address ends with ?topic=/camera/image_raw, for instance")
    if transport not in ("raw", "compressed"):
        raise QueryError(400, "default_transport=%s is not served; raw and compressed are" % transport)
    kind, usual, most = _TYPES[name]
    quality = _number(get, "quality")
    form = ImageForm(kind, usual if quality is None else min(max(quality, 0), most), _side(get, "width"),
                     _side(get, "height"), get("invert") is not None)
    return VideoQuery(topic, form, "original" if name == "ros_compressed" else transport)


def _number(get: Callable[[Any], Any], name: str) -> int | None:
    """A number as the nearest integer; None where there is none. Raises QueryError."""
    text = get(name)
    if text in (None, ""):
        return None
    try:
        return round(float(text))
    except (ValueError, OverflowError):
        raise QueryError(400, "%s=%s is no number" % (name, text)) from None


def _side(get: Callable[..., Any], name: str) -> int | None:
    value = _number(get, name)
    if value in (None, -1):
        return None
    if not 0 < value <= _LARGEST_SIDE:
        raise QueryError(400, "%s=%d is not possible; 1 to %d are, and -1 for the image's own" % (
            name, value, _LARGEST_SIDE))
    return value


def routes(server: VideoServer) -> list[tuple[str, type, dict[str, VideoServer]]]:
    """The addresses for a tornado application."""
    return [(path, handler, {"server": server}) for path, handler in (
        ("/", ListHandler), ("/stream", StreamHandler), ("/stream_viewer", ViewerHandler),
        ("/snapshot", SnapshotHandler))]


class VideoServer:
    """State that the handlers share: cameras, options, and the open streams."""

    def __init__(self, cameras: Cameras, options: VideoOptions) -> None:
        self.cameras = cameras
        self.options = options
        self.streams = set()
        self._held: dict[Stream, int] = {}  # bytes
        self._held_bytes = 0

    def hold(self, stream: Stream, size: int) -> None:
        """``stream`` holds ``size`` bytes for its client. Beyond MAX_HELD_BYTES the streams that hold most end."""
        self._held_bytes += size - self._held.get(stream, 0)
        self._held[stream] = size
        while self._held_bytes > MAX_HELD_BYTES:
            largest = max(self._held, key=self._held.__getitem__)
            _LOG.warning("a stream ends: clients that do not read hold more than %d MB, and its image has %d MB",
                         MAX_HELD_BYTES >> 20, self._held[largest] >> 20)
            self.release(largest)
            largest.close()

    def release(self, stream: Stream) -> None:
        """``stream`` holds nothing more."""
        self._held_bytes -= self._held.pop(stream, 0)

    async def source(self, query: VideoQuery):
        """(the full name of the topic to subscribe to, the form). Raises BridgeError."""
        compressed = query.topic.rstrip("/") + "/compressed"
        if query.transport == "compressed":
            return await self.cameras.find(compressed, (COMPRESSED,)), query.form
        if query.transport == "original":
            # As web_video_server does for a camera without a compressed topic.
            with contextlib.suppress(NoSuchTopic):
                return await self.cameras.find(compressed, (COMPRESSED,)), ImageForm("original")
        return await self.cameras.find(query.topic), query.form

    async def close_all(self) -> None:
        for stream in list(self.streams):
            stream.close()


def check_request(access: Access, request: HTTPServerRequest) -> None:
    """Raise RequestForbidden unless a client, and the page that it shows, may look."""
    headers, host = request.headers, request.host
    access.may_act(token_of(request))
    if (origin := headers.get("Origin")) is not None:
        access.check_origin(origin, host)
        return
    access.check_host(host)
    # <img> sends no Origin; a link that a user follows may come from anywhere.
    page = headers.get("Referer")
    if page and host_of(page) != host_of(host) and headers.get("Sec-Fetch-Dest") != "document":
        access.check_origin(origin_of(page), host)


class _Handler(web.RequestHandler):
    def initialize(self, server: VideoServer) -> None:
        self._server = server
        self._gone = asyncio.Event()

    def set_default_headers(self) -> None:
        for name, value in _NOT_KEPT.items():
            self.set_header(name, value)

    def prepare(self) -> None:
        self._server.options.told("%s asks for %s" % (self.request.remote_ip, self.request.path))
        try:
            check_request(self._server.options.access, self.request)
        except RequestForbidden as error:
            _LOG.warning("a client at %s was refused: %s", self.request.remote_ip, error)
            self.refuse(403, error)
            return
        for name, value in self.cross_origin().items():
            self.set_header(name, value)

    def cross_origin(self) -> dict[str, str]:
        """Headers by which a browser lets the page of a checked origin read the answer."""
        origin = self.request.headers.get("Origin")
        return {} if origin is None else {"Access-Control-Allow-Origin": origin, "Vary": "Origin"}

    def refuse(self, status: int, error: Any) -> None:
        """A sentence instead of an image."""
        self.set_status(status)
        self.set_header("Content-Type", "text/plain; charset=utf-8")
        self.finish(str(error) + "\n")

    def last_argument(self, name: str) -> str | None:
        return self.get_query_argument(name, None)

    def on_connection_close(self) -> None:
        self._gone.set()

    async def get(self) -> None:
        try:
            await self.answer()
        except QueryError as error:
            self.refuse(error.status, error)
        except BridgeError as error:
            self.refuse(404 if isinstance(error, NoSuchTopic) else 400, error)

    async def answer(self) -> Message:
        """Serve the request. Raises BridgeError."""
        raise NotImplementedError


class ListHandler(_Handler):
    async def answer(self) -> None:
        topics = await self._server.cameras.published()
        self.finish(video_pages.topics(topics, IMAGE, token_of(self.request)))


class ViewerHandler(_Handler):
    async def answer(self) -> None:
        query = read_query(self.last_argument, self._server.options.default_type)
        self.finish(video_pages.viewer(query.topic, self.request.query))


class SnapshotHandler(_Handler):
    """One image: the next one, or the one that a publisher keeps for subscribers to come."""

    async def answer(self) -> None:
        server = self._server
        query = read_query(self.last_argument)
        topic, form = await server.source(query)
        viewer = _One()
        await server.cameras.join(topic, viewer)
        try:
            if (last := server.cameras.last(topic, is_latched=True)) is not None:
                viewer.show(last)
            gone = asyncio.ensure_future(self._gone.wait())
            await asyncio.wait({viewer.picture, gone}, timeout=server.options.snapshot_s,
                               return_when=asyncio.FIRST_COMPLETED)
            gone.cancel()
        finally:
            server.cameras.leave(topic, viewer)
        if self._gone.is_set():
            return
        if not viewer.picture.done():
            raise QueryError(504, "no image came on %s within %g s; its publisher may be paused" % (
                topic, server.options.snapshot_s))
        frame = await viewer.picture.result().encoded(form)
        self.set_header("Content-Type", frame.content_type)
        self.set_header("X-Timestamp", frame.stamp)
        self.finish(frame.data)


class _One:
    """A viewer that keeps one picture."""

    def __init__(self) -> None:
        self.picture = asyncio.get_running_loop().create_future()

    def show(self, picture: EncodedImage) -> None:
        if not self.picture.done():
            self.picture.set_result(picture)


class StreamHandler(_Handler):
    async def answer(self) -> None:
        server = self._server
        query = read_query(self.last_argument, server.options.default_type)
        if len(server.streams) >= MAX_CLIENTS:
            raise QueryError(503, "%d streams are open, which is the limit" % MAX_CLIENTS)
        topic, form = await server.source(query)
        headers = {**_NOT_KEPT, **self.cross_origin()}
        stream = Stream(self.detach(), topic, form, server)
        server.streams.add(stream)
        try:
            await server.cameras.join(topic, stream)
            if (last := server.cameras.last(topic)) is not None:
                stream.show(last)
            await stream.run(headers)
        except iostream.StreamClosedError:
            pass  # the client has gone
        except BridgeError as error:
            _LOG.warning("the stream of %s ends: %s", topic, error)
        finally:
            server.streams.discard(stream)
            server.release(stream)
            server.cameras.leave(topic, stream)
            stream.close()


class Stream:
    """The images of one client."""

    def __init__(self, connection: iostream.IOStream, topic: str, form: ImageForm, server: VideoServer) -> None:
        self._server = server
        self._connection = connection
        self._topic = topic
        self._form = form
        self._repeat_s = server.options.repeat_s
        self._newest = None
        self._changed = asyncio.Event()
        self._told = ""
        connection.set_nodelay(True)
        if hasattr(socket, "TCP_NOTSENT_LOWAT"):
            own = cast("socket.socket", connection.socket)
            own.setsockopt(socket.IPPROTO_TCP, socket.TCP_NOTSENT_LOWAT, _UNSENT_BYTES)
        connection.set_close_callback(self._changed.set)

    def show(self, picture: EncodedImage) -> None:
        """The newest picture, instead of one that was not yet looked at."""
        self._newest = picture
        self._changed.set()

    def close(self) -> None:
        self._connection.close()

    async def run(self, headers: dict[str, str]) -> Any:
        """Write pictures until the connection ends. Raises StreamClosedError."""
        headers = {**headers, "Connection": "close", "Content-type": "multipart/x-mixed-replace;boundary=" + BOUNDARY}
        head = "".join("%s: %s\r\n" % item for item in headers.items())
        await self._connection.write(("HTTP/1.1 200 OK\r\n%s\r\n--%s\r\n" % (head, BOUNDARY)).encode("latin-1"))
        frame = None
        while True:
            picture = await self._next(self._repeat_s if frame is not None else 0.0)
            if picture is not None:
                frame = await self._encoded(picture)
            elif frame is not None:
                frame = frame._replace(stamp="%.6f" % time.time())
            if frame is not None:
                head = "Content-type: %s\r\nX-Timestamp: %s\r\nContent-Length: %d\r\n\r\n" % (
                    frame.content_type, frame.stamp, len(frame.data))
                self._server.hold(self, len(frame.data))
                await self._connection.write(head.encode() + frame.data + b"\r\n--%s\r\n" % BOUNDARY.encode())
            if not self._repeat_s:
                frame = None
                self._server.release(self)

    async def _next(self, limit_s: float):
        """The picture that came after the last one; None after ``limit_s`` (0: waits on). Raises StreamClosedError."""
        while True:
            if self._connection.closed():
                raise iostream.StreamClosedError
            if (picture := self._newest) is not None:
                self._newest = None
                return picture
            self._changed.clear()
            try:
                await asyncio.wait_for(self._changed.wait(), limit_s or None)
            except TimeoutError:
                return None

    async def _encoded(self, picture: EncodedImage):
        """The picture as this client wants it, or None where it cannot be shown."""
        try:
            return await picture.encoded(self._form)
        except BridgeError as error:
            # The same reason once, not with each image.
            if str(error) != self._told:
                self._told = str(error)
                _LOG.warning("an image of %s is not shown: %s", self._topic, shown(error))
            return None
