# SPDX-License-Identifier: BSD-3-Clause
"""The front door of a class, on tornado: one address for each student, passed on to the lab; the instructor's page.

It checks who asks before it wakes a lab or passes anything on.
"""
import asyncio
import contextlib
import hmac
import html
import json
from urllib.parse import urlsplit

from tornado import httputil, iostream, web

from lab_class import http_text
from lab_class.labs import MOST_FAILURES, ClassError, Role, State, may

_CHUNK = 65536
#: A request's body; the largest are recordings and notebooks [bytes].
LARGEST_BODY = 32 << 20
#: Requests and open pages of one lab at a time; a lab, or a page in a loop, must not take the descriptors of all.
MOST_AT_ONCE = 64
#: Time for a lab to begin its answer, or to read more of a body [s].
ANSWER_S = 60.0
#: The waiting page asks again after this time [s].
_AGAIN_S = 2
_METHODS = ("GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS")
_WAITING = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><meta http-equiv="refresh" content="%d">
<meta name="viewport" content="width=device-width, initial-scale=1"><title>Lab of %s</title></head>
<body style="font: 1.2em sans-serif; margin: 3em"><h1>Lab of %s</h1><p>%s</p></body></html>
"""


def same(token, known):
    """Compare two tokens in a time that does not tell where they differ."""
    return hmac.compare_digest(token.encode("utf-8", "surrogateescape"), known.encode())


class Door:
    """What the handlers share. ``record``: store.ClassRecord; ``supervisor``: supervisor.Supervisor."""

    def __init__(self, record, supervisor):
        self.record, self.supervisor = record, supervisor
        self.full_names = {student.name: student.full_name for student in record.students}

    def role(self, name, tokens):
        """The Role that one of the tokens gives for the lab of this name; None."""
        known = self.record.tokens.get(name)
        if known is None:
            return None
        for role, right in ((Role.STUDENT, known.act), (Role.VIEWER, known.view)):
            if any(same(token, right) for token in tokens):
                return role
        return None

    def is_instructor(self, token):
        return same(token, self.record.instructor)

    def words_of(self, lab):
        """What a lab that does not run says to its student."""
        if lab.state is State.WAITING:
            before = self.supervisor.labs.place_in_line(lab.name)
            return "The lab is going to start; %s." % ("%d start before it" % before if before else "it is the next")
        if lab.state is State.STARTING:
            return "The lab is starting. This page opens it as soon as it runs."
        if lab.state is State.FAILED:
            again = "It starts again." if lab.failures < MOST_FAILURES else "The instructor can start it again."
            return "The lab has ended: %s. %s" % (lab.reason, again)
        return "The instructor has stopped this lab."


class _Handler(web.RequestHandler):
    def initialize(self, door):
        self.door = door

    def set_default_headers(self):
        self.set_header("Referrer-Policy", "no-referrer")
        self.set_header("X-Content-Type-Options", "nosniff")
        self.set_header("Cache-Control", "no-store")
        self.clear_header("Server")

    def refuse(self, status, text):
        self.set_status(status)
        self.set_header("Content-Type", "text/plain; charset=utf-8")
        self.finish(text + "\n")


class Start(_Handler):
    """The address without a name."""

    def get(self):
        self.refuse(404, "Your lab has an address of this form, with your name and your token: http://%s/NAME/?token=..."
                    % self.request.host)


def is_foreign(request):
    """Does a page of another origin make this request?"""
    origin = request.headers.get("Origin")
    return origin is not None and urlsplit(origin).netloc != request.host


@web.stream_request_body
class Passed(_Handler):
    """A request for a lab: /NAME/..."""

    SUPPORTED_METHODS = _METHODS

    async def prepare(self):
        self._streams, self._counted, self._name = None, False, self.path_args[0]
        self._prefix = "/" + self._name
        path, _, query = self.request.uri.partition("?")
        self._below = path[len(self._prefix):] + ("?" + query if query else "")
        self._is_upgrade = http_text.is_upgrade(self.request.headers)
        length = self.request.headers.get("Content-Length", "")
        self._length = int(length) if length.isdecimal() else 0  # tornado refuses what is no number
        if not self._lets_in():
            return
        if not self._below.startswith("/"):
            self.redirect(self._prefix + "/" + self._below)
            return
        lab = self.door.supervisor.request(self._name)
        if lab.state is not State.RUNNING:
            self._say_wait(lab)
        elif lab.busy + lab.pages >= MOST_AT_ONCE:
            self.refuse(429, "this lab has %d requests and open pages already; close some" % MOST_AT_ONCE)
        else:
            await self._begin()

    def _lets_in(self):
        """Whether this request may go on; else it is refused."""
        token, cookie = self.get_query_argument("token", ""), self.get_cookie(http_text.COOKIE, "")
        self._role = self.door.role(self._name, [token] if token else [cookie])
        if not may(self._role, "watch"):
            self.refuse(403, "This address needs the token of this lab: /%s/?token=..." % self._name[:60])
        elif is_foreign(self.request):
            self.refuse(403, "a page of %s may not use this lab" % self.request.headers["Origin"][:200])
        elif "Transfer-Encoding" in self.request.headers:
            self.refuse(411, "a request's body needs a length here")
        elif self._length > LARGEST_BODY:
            self.refuse(413, "a request may have %d MB, not %d" % (LARGEST_BODY >> 20, self._length >> 20))
        else:
            self.request.connection.set_max_body_size(LARGEST_BODY)
            if token:
                self.set_cookie(http_text.COOKIE, token, path=self._prefix + "/", httponly=True, samesite="Strict")
            return True
        return False

    async def _begin(self):
        """Connect to the lab, and pass the head of the request on; its body follows as it comes in.

        It counts from here on: a body may come in slowly, and a lab that is served must not be paused."""
        self._counted = True
        self.door.supervisor.serving(self._name, self._is_upgrade, 1)
        try:
            self._streams = await asyncio.open_unix_connection(str(self.door.supervisor.socket_of(self._name)),
                                                               limit=http_text.LARGEST_HEAD)
        except OSError as error:
            self._leave()
            self._refuse_lab(error)
            return
        self._streams[1].write(http_text.request_head(self.request.method, self._below, self.request.headers,
                                                      self._length, self._is_upgrade))

    async def data_received(self, chunk):
        if self._streams is None:
            return
        # A lab that does not read holds its client up, and not the front door's memory.
        try:
            self._streams[1].write(chunk)
            async with asyncio.timeout(ANSWER_S):
                await self._streams[1].drain()
        except TimeoutError:
            # Meanwhile nothing tells whether the client is still there.
            self.request.connection.stream.close()
        except OSError:
            pass  # what the lab has answered before it went is read afterwards

    def on_connection_close(self):
        # Also of a client that goes in the middle of its request.
        super().on_connection_close()
        self._leave()

    def _leave(self):
        if self._streams is not None:
            self._streams[1].close()
        if self._counted:
            self._counted = False
            self.door.supervisor.serving(self._name, self._is_upgrade, -1)

    def _refuse_lab(self, error):
        self.refuse(502, "the lab does not answer: %s" % (error or type(error).__name__))

    async def _pass(self, *_):
        try:
            if self._is_upgrade:
                await self._tunnel()
            else:
                await self._answer()
        except (OSError, EOFError, asyncio.LimitOverrunError, http_text.BadAnswer) as error:
            if not self._finished and not self._headers_written and not self.detached:
                self._refuse_lab(error)
        finally:
            self._leave()

    get = head = post = put = patch = delete = options = _pass

    detached = False

    def _say_wait(self, lab):
        words = self.door.words_of(lab)
        if "text/html" not in self.request.headers.get("Accept", ""):
            self.set_header("Retry-After", str(_AGAIN_S))
            self.refuse(503, words)
            return
        self.set_status(503)
        name = html.escape(self.door.full_names[self._name])
        self.finish(_WAITING % (_AGAIN_S, name, name, html.escape(words)))

    async def _head(self):
        """(status, headers) of the lab's answer."""
        async with asyncio.timeout(ANSWER_S):
            return http_text.answer_head(await self._streams[0].readuntil(b"\r\n\r\n"))

    async def _answer(self):
        status, headers = await self._head()
        try:
            self.set_status(status)
            # The lab says how long its answers may be kept.
            self.clear_header("Cache-Control")
            for name, value in http_text.passed_on(headers, self._prefix):
                (self.add_header if name == "Set-Cookie" else self.set_header)(name, value)
            if self.request.method != "HEAD" and status not in (204, 304):
                while chunk := await self._streams[0].read(_CHUNK):
                    self.write(chunk)
                    await self.flush()
            await self.finish()
        except (iostream.StreamClosedError, httputil.HTTPOutputError):
            # The client has gone, or the lab's answer has not the length that it announced.
            self.request.connection.stream.close()

    async def _tunnel(self):
        status, headers = await self._head()
        if status != 101:
            self.refuse(403 if status == 403 else 502, "the lab refused this connection (%d)" % status)
            return
        self.detached = True
        client = self.detach()
        try:
            await client.write(http_text.upgrade_text(headers))
            await self._copy_both(client, *self._streams)
        except iostream.StreamClosedError:
            pass
        finally:
            client.close()

    async def _copy_both(self, client, reader, writer):
        async def to_client():
            while chunk := await reader.read(_CHUNK):
                await client.write(chunk)

        async def to_lab():
            while True:
                chunk = await client.read_bytes(_CHUNK, partial=True)
                if not http_text.is_heartbeat(chunk):
                    self.door.supervisor.request(self._name)
                # A paused lab would find old heartbeats when it wakes, and take them for a page that is there.
                elif not self.door.supervisor.is_awake(self._name):
                    continue
                writer.write(chunk)
                await writer.drain()

        tasks = [asyncio.ensure_future(copy) for copy in (to_client(), to_lab())]
        _, others = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        for task in others:
            task.cancel()
        for task in tasks:
            with contextlib.suppress(asyncio.CancelledError, iostream.StreamClosedError, OSError):
                await task


class _ForInstructor(_Handler):
    """Needs the instructor's token in a header, which no page of a lab can send; ``trusted``: at the control socket,
    which belongs to the owner of the class alone."""

    def initialize(self, door, trusted=False):
        super().initialize(door)
        self._trusted = trusted

    def prepare(self):
        scheme, _, token = self.request.headers.get("Authorization", "").partition(" ")
        if not self._trusted and not (scheme == "Bearer" and self.door.is_instructor(token)):
            self.refuse(403, "this needs the instructor's token")
        elif is_foreign(self.request):
            self.refuse(403, "a page of another address may not do this")


class Overview(_ForInstructor):
    """All labs, as JSON."""

    def get(self):
        self.set_header("Content-Type", "application/json")
        self.finish(json.dumps(self.door.supervisor.overview()))


class Change(_ForInstructor):
    """POST /instructor/labs/NAME/VERB: start, stop or pause one lab."""

    def post(self, name, verb):
        try:
            self.door.supervisor.change(name, verb)
        except ClassError as error:
            self.refuse(409, str(error))
            return
        self.set_status(204)


class Down(_ForInstructor):
    """Ends the class; at the control socket alone."""

    def post(self):
        self.door.supervisor.end()
        self.set_status(204)


class InstructorPage(_Handler):
    """The page has no secret; the labs that it shows need the token."""

    def initialize(self, door, page):
        super().initialize(door)
        self._page = page

    def get(self, name=""):
        kinds = {"": ("instructor.html", "text/html"), "instructor.js": ("instructor.js", "text/javascript"),
                 "instructor.css": ("instructor.css", "text/css")}
        if name not in kinds:
            self.refuse(404, "there is no such page")
            return
        file, kind = kinds[name]
        self.set_header("Content-Type", kind + "; charset=utf-8")
        self.set_header("Content-Security-Policy", "default-src 'self'; frame-ancestors 'none'")
        self.finish((self._page / file).read_text(encoding="utf-8"))


def application(door, page):
    """The front door; ``page``: folder of the instructor's page [Path]."""
    return web.Application([
        (r"/", Start, {"door": door}),
        (r"/instructor/labs", Overview, {"door": door}),
        (r"/instructor/labs/([a-z0-9-]+)/([a-z]+)", Change, {"door": door}),
        (r"/instructor/([a-z.]*)", InstructorPage, {"door": door, "page": page}),
        (r"/([a-z0-9-]+)(?:/.*)?", Passed, {"door": door})], log_function=lambda handler: None)


def control(door):
    """The same for the commands of the class's owner, at the control socket."""
    owner = {"door": door, "trusted": True}
    return web.Application([(r"/labs", Overview, owner), (r"/labs/([a-z0-9-]+)/([a-z]+)", Change, owner),
                            (r"/down", Down, owner)], log_function=lambda handler: None)
