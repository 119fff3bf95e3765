# SPDX-License-Identifier: BSD-3-Clause
"""The front door of a class, on tornado: one address for each student, passed on to the lab; the instructor's page.

It checks who asks before it wakes a lab or passes anything on.
"""
from __future__ import annotations

import hmac
import html
import json
import re
from typing import TYPE_CHECKING

from tornado import web

from lab_class.labs import MAX_FAILURES, ClassError, ClassLabState, Kind, Role, may
from lab_class.store import StoreError
from web_bridge import http_text
from web_bridge.passing import PassingHandler, PlainHandler, is_foreign

if TYPE_CHECKING:
    from pathlib import Path

    from tornado.httputil import HTTPHeaders

    from lab_class.labs import ClassLab
    from lab_class.store import ClassRecord
    from lab_class.supervisor import Supervisor

#: The cookie that opens one lab, for its path alone.
COOKIE = "lab_token"
#: Requests and open pages of one lab at a time; a lab, or a page in a loop, must not take the descriptors of all.
MAX_AT_ONCE = 64
#: The waiting page asks again after this time [s].
_AGAIN_S = 2
# What an open JupyterLab asks again and again, without its user, beside listings of folders.
_POLLED = ("kernels", "sessions", "terminals", "kernelspecs")
_WAITING = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><meta http-equiv="refresh" content="%d">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark"><title>Lab of %s</title></head>
<body style="font: 1.2em sans-serif; margin: 3em"><h1>Lab of %s</h1><p>%s</p></body></html>
"""


def same(token: str, known: str) -> bool:
    """Compare two tokens in a time that does not tell where they differ."""
    return hmac.compare_digest(token.encode("utf-8", "surrogateescape"), known.encode())


class FrontDoor:
    """State that the handlers share. ``record``: store.ClassRecord; ``supervisor``: supervisor.Supervisor."""

    def __init__(self, record: ClassRecord, supervisor: Supervisor) -> None:
        self.record, self.supervisor = record, supervisor
        self.full_names = {student.name: student.full_name for student in record.students}

    def role(self, name: str, tokens: list[str]) -> Role | None:
        """The Role that one of the tokens gives for the lab of this name; None."""
        known = self.record.tokens.get(name)
        if known is None:
            return None
        for role, right in ((Role.STUDENT, known.act), (Role.VIEWER, known.view)):
            if any(same(token, right) for token in tokens):
                return role
        return None

    def is_instructor(self, token: str) -> bool:
        return same(token, self.record.instructor)

    def words_of(self, lab: ClassLab) -> str:
        """The text for the student of a lab that does not run."""
        if lab.state is ClassLabState.WAITING and lab.reason:
            return "The lab is going to start. It waits: %s." % lab.reason
        if lab.state is ClassLabState.WAITING:
            before = self.supervisor.labs.place_in_line(lab.name)
            return "The lab is going to start; %s." % ("%d start before it" % before if before else "it is the next")
        if lab.state is ClassLabState.STARTING:
            return "The lab is starting. This page opens it as soon as it runs."
        if lab.state is ClassLabState.FAILED:
            again = "It starts again." if lab.failures < MAX_FAILURES else "The instructor can start it again."
            return "The lab has ended: %s. %s" % (lab.reason, again)
        return "The instructor has stopped this lab."


class _Handler(PlainHandler):
    def initialize(self, door: FrontDoor) -> None:
        self.door = door


class Start(_Handler):
    """The address without a name."""

    def get(self) -> None:
        options = self.door.record.options
        self.refuse(404, "Your lab has an address of this form, with your name and your token: %s/NAME/?token=..."
                    % (options.address or "http://" + self.request.host))


def is_poll(method: str, uri: str) -> bool:
    """Does an open JupyterLab ask this by itself? uri: path and query below the lab. It wakes no lab."""
    path, _, query = uri.partition("?")
    name = path.removeprefix("/notebook/api/")
    if method != "GET" or name == path:
        return False
    # A file that its user opens has a type.
    return name in _POLLED or (name.partition("/")[0] == "contents" and "type=file" not in query
                               and "type=notebook" not in query)


def kind_of(is_upgrade: bool, uri: str) -> Kind:
    """The labs.Kind of a connection; uri: path and query below the lab. A page of the lab has one WebSocket /lab."""
    if not is_upgrade:
        return Kind.ANSWER
    return Kind.PAGE if uri.partition("?")[0] == "/lab" else Kind.SOCKET


class Passed(PassingHandler):
    """A request for a lab: /NAME/..."""

    SERVER, OWN_COOKIE = "the lab", COOKIE

    def initialize(self, door: FrontDoor) -> None:
        super().initialize()
        self.door = door

    async def prepare(self) -> None:
        self._name = self.path_args[0]
        self._prefix = "%s/%s" % (self.door.record.options.prefix, self._name)
        path, _, query = self.request.uri.partition("?")
        below = path[len(self._prefix):] + ("?" + query if query else "")
        if not self._lets_in():
            return
        if not below.startswith("/"):
            self.redirect(self._prefix + "/" + below)
            return
        self._is_poll = is_poll(self.request.method, below)
        self._kind = kind_of(self.is_upgrade, below)
        if self._is_poll:
            if self.door.supervisor.is_awake(self._name):
                await self.pass_to(str(self.door.supervisor.socket_of(self._name)), below)
            else:
                # 503 would make JupyterLab ask its user what to do.
                self.refuse(409, "this lab is not awake")
            return
        lab = self.door.supervisor.request(self._name)
        if lab.state is not ClassLabState.RUNNING:
            self._say_wait(lab)
        elif lab.busy + lab.sockets >= MAX_AT_ONCE:
            self.refuse(429, "this lab has %d requests and open pages already; close some" % MAX_AT_ONCE)
        else:
            await self.pass_to(str(self.door.supervisor.socket_of(self._name)), below)

    def _lets_in(self) -> bool:
        """Whether this request may go on; else it is refused."""
        token, cookie = self.get_query_argument("token", ""), self.get_cookie(COOKIE, "")
        self._role = self.door.role(self._name, [token] if token else [cookie])
        if not may(self._role, "watch"):
            self.refuse(403, "This address needs the token of this lab: /%s/?token=..." % self._name[:60])
        elif self.takes_request():
            if token:
                encrypted = self.door.record.options.address.startswith("https:")
                self.set_cookie(COOKIE, token, path=self._prefix + "/", httponly=True, samesite="Strict",
                                secure=encrypted)
            return True
        return False

    def answer_headers(self, headers: HTTPHeaders) -> list[tuple[str, str]]:
        return http_text.passed_on(headers, self._prefix, own_cookie=COOKIE)

    def entered(self) -> None:
        # A lab that is served must not be paused.
        if not self._is_poll:
            self.door.supervisor.serving(self._name, self._kind, 1)

    def left(self) -> None:
        if not self._is_poll:
            self.door.supervisor.serving(self._name, self._kind, -1)

    def may_pass(self, chunk: bytes) -> bool:
        if not http_text.is_heartbeat(chunk):
            self.door.supervisor.request(self._name)
            return True
        # A paused lab would find old heartbeats when it wakes, and take them for a page that is there.
        return self.door.supervisor.is_awake(self._name)

    def _say_wait(self, lab: ClassLab) -> None:
        words = self.door.words_of(lab)
        if "text/html" not in self.request.headers.get("Accept", ""):
            self.set_header("Retry-After", str(_AGAIN_S))
            self.refuse(503, words)
            return
        self.set_status(503)
        name = html.escape(self.door.full_names[self._name])
        self.finish(_WAITING % (_AGAIN_S, name, name, html.escape(words)))


class _ForInstructor(_Handler):
    """Needs the instructor's token in a header, which no page of a lab can send; ``trusted``: at the control socket,
    which belongs to the owner of the class alone."""

    def initialize(self, door: FrontDoor, trusted: bool = False) -> None:
        super().initialize(door)
        self._trusted = trusted

    def prepare(self) -> None:
        scheme, _, token = self.request.headers.get("Authorization", "").partition(" ")
        if not self._trusted and not (scheme == "Bearer" and self.door.is_instructor(token)):
            self.refuse(403, "this needs the instructor's token")
        elif is_foreign(self.request):
            self.refuse(403, "a page of another address may not do this")


class Overview(_ForInstructor):
    """All labs, as JSON."""

    def get(self) -> None:
        self.set_header("Content-Type", "application/json")
        # What comes out of labs was checked where it came in; no browser reads Python's NaN.
        self.finish(json.dumps(self.door.supervisor.overview(), allow_nan=False))


class Change(_ForInstructor):
    """POST /instructor/labs/NAME/VERB: start, stop or pause one lab."""

    def post(self, name: str, verb: str) -> None:
        try:
            self.door.supervisor.change(name, verb)
        except ClassError as error:
            self.refuse(409, str(error))
            return
        self.set_status(204)


class Renew(_ForInstructor):
    """POST /renew/NAME: new tokens for a student or the instructor; at the control socket alone."""

    def post(self, name: str) -> None:
        try:
            self.door.supervisor.renew(name)
        except (ClassError, StoreError) as error:
            self.refuse(409, str(error))
            return
        self.set_status(204)


class Down(_ForInstructor):
    """Ends the class; at the control socket alone."""

    def post(self) -> None:
        self.door.supervisor.end()
        self.set_status(204)


class InstructorPage(_Handler):
    """The page has no secret; the labs that it shows need the token."""

    def initialize(self, door: FrontDoor, page: Path) -> None:
        super().initialize(door)
        self._page = page

    def get(self, name: str = "") -> None:
        kinds = {"": ("instructor.html", "text/html"), "instructor.js": ("instructor.js", "text/javascript"),
                 "instructor.css": ("instructor.css", "text/css")}
        if name not in kinds:
            self.refuse(404, "there is no such page")
            return
        file, kind = kinds[name]
        self.set_header("Content-Type", kind + "; charset=utf-8")
        self.set_header("Content-Security-Policy", "default-src 'self'; img-src data:; frame-ancestors 'none'")
        self.finish((self._page / file).read_text(encoding="utf-8"))


def application(door: FrontDoor, page: Path) -> web.Application:
    """The front door; ``page``: folder of the instructor's page [Path]."""
    prefix = re.escape(door.record.options.prefix)
    return web.Application([
        (prefix + r"/", Start, {"door": door}),
        (prefix + r"/instructor/labs", Overview, {"door": door}),
        (prefix + r"/instructor/labs/([a-z0-9-]+)/([a-z]+)", Change, {"door": door}),
        (prefix + r"/instructor/([a-z.]*)", InstructorPage, {"door": door, "page": page}),
        (prefix + r"/([a-z0-9-]+)(?:/.*)?", Passed, {"door": door})], log_function=lambda handler: None)


def control(door: FrontDoor) -> web.Application:
    """The same for the commands of the class's owner, at the control socket."""
    owner = {"door": door, "trusted": True}
    return web.Application([(r"/labs", Overview, owner), (r"/labs/([a-z0-9-]+)/([a-z]+)", Change, owner),
                            (r"/renew/([a-z0-9-]+)", Renew, owner), (r"/down", Down, owner)],
                           log_function=lambda handler: None)
