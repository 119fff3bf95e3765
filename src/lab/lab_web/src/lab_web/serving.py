# SPDX-License-Identifier: BSD-3-Clause
"""The page's files and its socket, on tornado. No ROS."""
from __future__ import annotations

import asyncio
import base64
import hashlib
import json
import re
import tempfile
import threading
from typing import TYPE_CHECKING

from tornado import web
from tornado.http1connection import HTTP1Connection

from demonstrations.frames import DemonstrationError
from lab_web.control import HEARTBEAT_S, PAGE_HANGS_S
from lab_web.motion import MotionError
from lab_web.playback import recording_of, text_of
from web_bridge.errors import RequestForbidden
from web_bridge.websocket import BufferedSocket, token_of

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path
    from typing import Any, BinaryIO

    from lab_web import scene
    from lab_web.episodes import Episodes
    from lab_web.lab import PageLab
    from lab_web.playback import MotionRecorder
    from web_bridge.access import Access
    from web_bridge.loop_thread import LoopThread
    from web_bridge.outgoing import OutgoingBuffer

#: Pages at a time.
MAX_PAGES = 100
#: An operation of a page is small [bytes].
_LARGEST_OPERATION = 65536
#: A file from a page, such as ten minutes of both arms [bytes].
_LARGEST_UPLOAD = 16 << 20
#: A part of a file to a page [bytes].
_CHUNK = 1 << 18
#: The robot's screen, width and height [pixels]; pages send it whole.
SCREEN = (1024, 600)
# Everything comes from this server, so that the page works without a network and loads nothing foreign.
_POLICY = "default-src 'self'; script-src 'self'%s; img-src 'self' data:; connect-src 'self' ws: wss:; " \
          "frame-src 'self'; frame-ancestors 'self'"


def policy(page_text: str = "") -> str:
    """The Content-Security-Policy of a page with this text: the only script inside of it is its import map."""
    inline = re.findall(r'<script type="importmap">(.*?)</script>', page_text, re.DOTALL)
    return _POLICY % "".join(" 'sha256-%s'" % base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
                             for text in inline)


class Pages:
    """The connected pages of a PageLab. ``access``: web_bridge.access.Access."""

    def __init__(self, access: Access, loop_thread: LoopThread, lab: PageLab) -> None:
        self.access = access
        self.loop_thread = loop_thread
        self.lab = lab
        #: The scene of now (:class:`lab_web.scene.SceneText`) and its newest poses, or None.
        self.picture: scene.SceneText | None = None
        self.poses: bytes | None = None
        #: Called with the number of a page that has gone, in the loop; does not wait.
        self.when_closed: Callable[[int], object] = lambda number: None
        #: Set while there is a page.
        self.present = threading.Event()
        self._shared: dict[str, dict[str, Any]] = {"robot": {"op": "robot"}}
        self._sockets: dict[int, PageSocket] = {}

    def __len__(self) -> int:
        return len(self._sockets)

    @property
    def shared(self) -> list[dict[str, Any]]:
        """The first messages to every page."""
        return list(self._shared.values())

    @property
    def is_full(self) -> bool:
        return len(self._sockets) >= MAX_PAGES

    def opened(self, socket: PageSocket) -> None:
        self._sockets[socket.number] = socket
        self.present.set()
        self.control_changed()

    def closed(self, socket: PageSocket) -> None:
        if self._sockets.pop(socket.number, None) is not None:
            if not self._sockets:
                self.present.clear()
            self.control_changed()
            self.when_closed(socket.number)

    # From any thread.

    def control_changed(self) -> None:
        """Tell all pages who has the control."""
        self.loop_thread.soon(self._send_control)

    def tell(self, number: int | None, code: str, text: str) -> None:
        """Tell one page, or all (None)."""
        self.loop_thread.soon(self._tell, number, code, text)

    def answer(self, number: int | None, operation: dict[str, Any]) -> None:
        """An answer to one page."""
        self.loop_thread.soon(self._send_one, number, operation)

    def share(self, name: str, values: Mapping[str, Any]) -> None:
        """Tell all pages the operation ``name`` with ``values``, and each page that comes later."""
        operation = {"op": name, **values}
        self._shared[name] = operation
        self.loop_thread.soon(self._send_all, operation)

    def show_poses(self, picture: scene.SceneText, poses: bytes) -> None:
        """New poses of the scene ``picture``."""
        self.picture, self.poses = picture, poses
        for socket in list(self._sockets.values()):
            socket.out.offer([poses], "poses", 1)

    def show(self, number: int, data: bytes) -> None:
        """Bytes to one page, in the place of older ones that it has not got yet."""
        socket = self._sockets.get(number)
        if socket is not None:
            socket.out.offer([data], "points", 1)

    # In the loop.

    def _send_all(self, operation: dict[str, Any]) -> None:
        for socket in self._sockets.values():
            socket.send(operation)

    def _send_one(self, number: int | None, operation: dict[str, Any]) -> None:
        if number is not None and number in self._sockets:
            self._sockets[number].send(operation)

    def _send_control(self) -> None:
        holder = self.lab.holder
        for number, socket in self._sockets.items():
            socket.send({"op": "control", "mine": holder == number, "free": holder is None,
                         "pages": len(self._sockets)})

    def _tell(self, number: int | None, code: str, text: str) -> None:
        operation = {"op": "told", "code": code, "text": text}
        if number is None:
            self._send_all(operation)
        else:
            self._send_one(number, operation)


class _WithToken(web.RequestHandler):
    """Files that need a token, of either kind."""

    def initialize(self, pages: Pages) -> None:
        self.pages = pages

    def prepare(self) -> None:
        try:
            self.pages.access.may_act(token_of(self.request))
        except RequestForbidden:
            self.set_status(403)
            self.finish("This address needs the token that ./baxter.sh web printed: …/?token=…\n")

    def set_default_headers(self) -> None:
        self.set_header("Referrer-Policy", "no-referrer")
        self.set_header("X-Content-Type-Options", "nosniff")
        self.set_header("Cache-Control", "no-store")


class Index(_WithToken):
    """The page."""

    def initialize(self, pages: Pages, text: str) -> None:
        super().initialize(pages)
        self._text = text

    def get(self) -> None:
        self.set_header("Content-Security-Policy", policy(self._text))
        self.finish(self._text)


class SceneHandler(_WithToken):
    """Which shapes there are, as JSON."""

    def get(self) -> None:
        if self.pages.picture is None:
            self.set_status(404)
            return
        self.set_header("Content-Type", "application/json")
        self.finish(self.pages.picture.text)


class ShapeHandler(_WithToken):
    """The triangles of one shape of the scene."""

    def get(self, name: str) -> None:
        content = None if self.pages.picture is None else self.pages.picture.shapes.get(name)
        if content is None:
            self.set_status(404)
            return
        self.set_header("Content-Type", "application/octet-stream")
        # A name belongs to its content.
        self.set_header("Cache-Control", "private, max-age=604800, immutable")
        self.finish(content)


@web.stream_request_body
class Upload(_WithToken):
    """Bytes for an operation of a page, which is told where it fails; ``read`` makes its value of them and raises
    MotionError. Nothing is read without the token.
    """

    def initialize(self, pages: Pages, operation: str, read: Callable[[bytes], Any] = bytes) -> None:
        super().initialize(pages)
        self._operation, self._read = operation, read
        self._body = bytearray()

    def prepare(self) -> None:
        super().prepare()
        if self._finished:
            return
        try:
            self.pages.access.check_origin(self.request.headers.get("Origin"), self.request.host)
            may_act = self.pages.access.may_act(token_of(self.request))
        except RequestForbidden as error:
            self.set_status(403)
            self.finish(str(error) + "\n")
            return
        connection = self.request.connection
        if not may_act:
            self.set_status(403)
            self.finish("this address only watches\n")
        elif isinstance(connection, HTTP1Connection):
            connection.set_max_body_size(_LARGEST_UPLOAD)

    def data_received(self, chunk: bytes) -> None:
        self._body += chunk

    async def post(self) -> None:
        number = self.get_query_argument("page", "")
        # Python refuses to read a number of thousands of digits.
        number = int(number) if number.isdecimal() and len(number) < 20 else 0
        self.set_status(204)
        try:
            # Reading may take a while; heartbeats go on.
            content = await asyncio.get_running_loop().run_in_executor(None, self._read, bytes(self._body))
        except MotionError as error:
            self.pages.tell(number, "refused", str(error))
            return
        # A page that has just sent this is there; its work on a picture may have kept its heartbeats back.
        self.pages.lab.beat(number)
        self.pages.lab.serve(number, True, {"op": self._operation, "content": content})


class RecordingFile(_WithToken):
    """The recording as a file; ``get_text()``: its text, or None."""

    def initialize(self, pages: Pages, get_text: Callable[[], str | None]) -> None:
        super().initialize(pages)
        self._get_text = get_text

    async def get(self) -> None:
        text = await asyncio.get_running_loop().run_in_executor(None, self._get_text)
        if text is None:
            self.set_status(404)
            return
        self.set_header("Content-Type", "text/csv; charset=utf-8")
        self.set_header("Content-Disposition", "attachment; filename=recording.csv")
        self.finish(text)


class EpisodePicture(_WithToken):
    """The strip of an episode; ``picture(number)``: a JPEG, raises DemonstrationError."""

    def initialize(self, pages: Pages, picture: Callable[[int], bytes]) -> None:
        super().initialize(pages)
        self._picture = picture

    async def get(self, number: str) -> None:
        try:
            content = await asyncio.get_running_loop().run_in_executor(None, self._picture, int(number))
        except (DemonstrationError, OSError) as error:
            self.set_status(404)
            self.finish("%s\n" % error)
            return
        self.set_header("Content-Type", "image/jpeg")
        self.finish(content)


class EpisodesFile(_WithToken):
    """All episodes as one file; ``write(file)``, raises DemonstrationError, OSError."""

    def initialize(self, pages: Pages, write: Callable[[BinaryIO], None]) -> None:
        super().initialize(pages)
        self._write = write

    async def get(self) -> None:
        loop = asyncio.get_running_loop()
        with tempfile.TemporaryFile() as file:
            try:
                await loop.run_in_executor(None, self._write, file)
            except (DemonstrationError, OSError) as error:
                self.set_status(500)
                self.finish("%s\n" % error)
                return
            file.seek(0)
            self.set_header("Content-Type", "application/zip")
            self.set_header("Content-Disposition", "attachment; filename=episodes.zip")
            while chunk := await loop.run_in_executor(None, file.read, _CHUNK):
                self.write(chunk)
                await self.flush()


class Files(web.StaticFileHandler):
    """The page's scripts, styles and texts, and its libraries: nothing of the lab, so no token."""

    @classmethod
    def get_absolute_path(cls, root: str, path: str) -> str:
        if "\0" in path:
            raise web.HTTPError(404)
        return super().get_absolute_path(root, path)

    def set_extra_headers(self, path: str) -> None:
        self.set_header("Cache-Control", "no-cache")
        self.set_header("X-Content-Type-Options", "nosniff")
        # A worker has the policy of its own file.
        self.set_header("Content-Security-Policy", policy())


class PageSocket(BufferedSocket):
    """One page: operations of :class:`lab_web.lab.PageLab` and heartbeats come in; control, robot and poses go out."""

    #: Its outgoing frames, once it is open.
    out: OutgoingBuffer
    _numbers = iter(range(1, 1 << 62))

    def initialize(self, pages: Pages) -> None:
        self._pages = pages
        self.number = next(self._numbers)

    def prepare(self) -> None:
        self.let_in(self._pages.access, self._pages.is_full, MAX_PAGES)

    def open(self, *_: str) -> None:
        self.out = self.start_writing(self._pages.loop_thread)
        self.send({"op": "hello", "number": self.number, "may_act": self.may_act,
                   "heartbeat_ms": 1000.0 * HEARTBEAT_S, "hangs_ms": 1000.0 * PAGE_HANGS_S})
        for operation in self._pages.shared:
            self.send(operation)
        if self._pages.poses is not None:
            self.out.offer([self._pages.poses], "poses", 1)
        self._pages.opened(self)

    def send(self, operation: dict[str, Any]) -> None:
        """An operation to the page."""
        self.out.keep([json.dumps(operation)])

    async def on_message(self, message: str | bytes) -> None:
        lab = self._pages.lab
        # Most frames are heartbeats.
        if message in ("beat", "busy"):
            lab.beat(self.number, page_answers=message == "beat")
            return
        try:
            if not isinstance(message, str) or len(message) > _LARGEST_OPERATION:
                raise ValueError
            operation = json.loads(message)
            if not isinstance(operation, dict):
                raise ValueError
        except (ValueError, RecursionError):
            self.send({"op": "told", "code": "unknown", "text": "an operation is a JSON object"})
            return
        lab.serve(self.number, self.may_act, operation)

    def on_close(self) -> None:
        if self.outgoing is None:
            return
        self.stop_writing()
        self._pages.closed(self)
        self._pages.lab.gone(self.number)


def upload_routes(pages: Pages, recorder: MotionRecorder) -> list[tuple[str, type[web.RequestHandler], dict[str, Any]]]:
    """The routes of files to and from pages; ``recorder``: :class:`lab_web.playback.MotionRecorder`."""
    def text():
        recording = recorder.recording
        return None if recording is None else text_of(recording)
    return [(r"/screen", Upload, {"pages": pages, "operation": "screen"}),
            (r"/recording", Upload, {"pages": pages, "operation": "load", "read": recording_of}),
            (r"/recording.csv", RecordingFile, {"pages": pages, "get_text": text})]


def episode_routes(pages: Pages, episodes: Episodes) -> list[tuple[str, type[web.RequestHandler], dict[str, Any]]]:
    """The routes of films and files of episodes; ``episodes``: :class:`lab_web.episodes.Episodes`."""
    return [(r"/episodes/([0-9]{1,9}).jpg", EpisodePicture, {"pages": pages, "picture": episodes.picture}),
            (r"/episodes.zip", EpisodesFile, {"pages": pages, "write": episodes.write_zip})]


def routes(pages: Pages, page: Path, libraries: Path) -> list[tuple[str, type[web.RequestHandler], dict[str, Any]]]:
    """The routes of the page; ``page``: the folder of its files, ``libraries``: of node_modules [pathlib.Path]."""
    text = (page / "index.html").read_text(encoding="utf-8")
    return [(r"/", Index, {"pages": pages, "text": text}), (r"/lab", PageSocket, {"pages": pages}),
            (r"/scene", SceneHandler, {"pages": pages}), (r"/scene/([0-9a-f]{24})", ShapeHandler, {"pages": pages}),
            (r"/page/(.*)", Files, {"path": str(page)}),
            (r"/three/(.*)", Files, {"path": str(libraries / "three")})]
