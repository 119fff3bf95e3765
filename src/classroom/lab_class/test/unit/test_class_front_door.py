# SPDX-License-Identifier: BSD-3-Clause
"""The front door on a real port, with labs that are small servers in this process."""
import asyncio
import contextlib
import json
from pathlib import Path

from tornado.httpserver import HTTPServer
from tornado.netutil import bind_sockets

from lab_class import front_door
from lab_class.labs import MAX_FAILURES, ClassLabState, Labs
from lab_class.store import ClassOptions, ClassRecord
from rf_checks import roster
from web_bridge import passing

LIMIT_S = 20.0
PAGE = Path(__file__).resolve().parents[2] / "page"
ANSWER = b"HTTP/1.0 200 OK\r\nContent-Length: 5\r\nX-Secret: y\r\n\r\nhello"
UPGRADED = b"HTTP/1.1 101 Switching Protocols\r\nSec-WebSocket-Accept: k\r\n\r\n"
# Without "Connection: Upgrade" the end of an answer is the end of its connection.
UPGRADE = {"Upgrade": "websocket", "Connection": "close", "Sec-WebSocket-Key": "k", "Sec-WebSocket-Version": "13"}
BEAT, OPERATION = b"\x81\x84mask" + b"beat", b"\x81\x85mask" + b"press"
LARGE = 64 << 20


class Supervisor:
    """The part of the supervisor that the front door sees; labs are named anna and ben, and both run."""

    def __init__(self, folder):
        self.labs = Labs(["anna", "ben"], 2, None)
        self._folder, self.requests = folder, []
        for lab in self.labs:
            lab.state = ClassLabState.RUNNING

    def socket_of(self, name):
        return self._folder / name

    def request(self, name):
        self.requests.append(name)
        self.labs.request(name, 0.0)
        return self.labs[name]

    def is_awake(self, name):
        return self.labs[name].state is ClassLabState.RUNNING

    def serving(self, name, kind, by):
        self.labs.serving(name, kind, by, 0.0)

    def change(self, name, verb):
        getattr(self.labs, verb)(name, 0.0)

    def overview(self):
        return {"labs": [lab.name for lab in self.labs]}


class House:
    """A front door; ``lab(reader, writer)`` serves a connection of anna's lab. An asynchronous context manager."""

    def __init__(self, folder, lab=None):
        self._folder, self._lab = folder, lab
        self.record = ClassRecord.made(ClassOptions(),
                                       [roster.Student("anna", "Anna <b>"), roster.Student("ben", "Ben")])
        self.supervisor = Supervisor(folder)
        self.tokens = self.record.tokens

    async def __aenter__(self):
        self._server = HTTPServer(front_door.application(front_door.FrontDoor(self.record, self.supervisor), PAGE),
                                  max_body_size=65536)
        sockets = bind_sockets(0, "127.0.0.1")
        self.port = sockets[0].getsockname()[1]
        self._server.add_sockets(sockets)
        self._labs = None
        if self._lab is not None:
            self._labs = await asyncio.start_unix_server(self._lab, str(self._folder / "anna"))
        return self

    async def __aexit__(self, *_):
        self._server.stop()
        await self._server.close_all_connections()
        if self._labs is not None:
            self._labs.close()

    async def connect(self, path, method="GET", token="", body=b"", **headers):
        """(reader, writer) of a connection on which the request has been sent."""
        reader, writer = await asyncio.open_connection("127.0.0.1", self.port)
        lines = ["%s %s%s HTTP/1.1" % (method, path, "?token=" + token if token else ""),
                 "Host: 127.0.0.1:%d" % self.port, *("%s: %s" % pair for pair in headers.items())]
        if body:
            lines.append("Content-Length: %d" % len(body))
        writer.write("\r\n".join([*lines, "", ""]).encode() + body)
        return reader, writer

    async def ask(self, path, *args, **options):
        """(status, head, body) of the answer."""
        reader, writer = await self.connect(path, *args, **{"Connection": "close", **options})
        try:
            head, _, body = (await reader.read()).partition(b"\r\n\r\n")
        finally:
            writer.close()
        return int(head.split()[1]), head.decode(), body


def run(coroutine):
    async def limited():
        async with asyncio.timeout(LIMIT_S):
            return await coroutine

    return asyncio.run(limited())


async def until(condition):
    while not condition():
        await asyncio.sleep(0.01)


async def hello(reader, writer):
    await reader.readuntil(b"\r\n\r\n")
    writer.write(ANSWER)
    writer.close()


def test_each_lab_opens_with_its_tokens_alone(tmp_path):
    async def check():
        async with House(tmp_path, hello) as house:
            anna, ben = (house.tokens[name] for name in ("anna", "ben"))
            for token in ("", "x", ben.act, ben.view, house.record.instructor, anna.act[:-1], anna.act + "a"):
                assert (await house.ask("/anna/", token=token))[0] == 403
            assert (await house.ask("/ben/", Cookie="lab_token=" + anna.act))[0] == 403
            assert (await house.ask("/cleo/", token=anna.act))[0] == 403
            assert house.supervisor.requests == []  # nobody without a token wakes a lab
            for token in (anna.act, anna.view):
                status, head, body = await house.ask("/anna/", token=token)
                assert (status, body) == (200, b"hello")
                assert "Set-Cookie: lab_token=%s; HttpOnly; Path=/anna/; SameSite=Strict" % token in head
                assert "X-Secret" not in head
            assert (await house.ask("/anna/", Cookie="lab_token=" + anna.act))[0] == 200

    run(check())


def test_pages_of_other_addresses_are_refused(tmp_path):
    async def check():
        async with House(tmp_path, hello) as house:
            token = house.tokens["anna"].act
            for origin in ("http://elsewhere.example", "null", "http://127.0.0.1:%d" % (house.port + 1)):
                for more in ({}, UPGRADE):
                    assert (await house.ask("/anna/lab", token=token, Origin=origin, **more))[0] == 403
            own = "http://127.0.0.1:%d" % house.port
            assert (await house.ask("/anna/", token=token, Origin=own))[0] == 200
            assert (await house.ask("/instructor/labs", Origin="http://elsewhere.example",
                                    Authorization="Bearer " + house.record.instructor))[0] == 403

    run(check())


def test_the_instructors_page_needs_its_token_in_a_header(tmp_path):
    async def check():
        async with House(tmp_path, hello) as house:
            right = house.record.instructor
            for path, method in (("/instructor/labs", "GET"), ("/instructor/labs/anna/stop", "POST")):
                for more in ({}, {"Authorization": right}, {"Authorization": "Bearer " + house.tokens["anna"].act},
                             {"Cookie": "lab_token=" + right}):
                    assert (await house.ask(path, method, body=b"x" if method == "POST" else b"", **more))[0] == 403
                assert (await house.ask(path, method, token=right))[0] == 403
            assert (await house.ask("/down", "POST"))[0] == 403
            assert house.supervisor.is_awake("anna")
            status, _, body = await house.ask("/instructor/labs", Authorization="Bearer " + right)
            assert (status, json.loads(body)) == (200, {"labs": ["anna", "ben"]})
            assert (await house.ask("/instructor/../class.json"))[0] in (403, 404)

    run(check())


def test_a_lab_that_does_not_run_says_what_is_to_come(tmp_path):
    async def check():
        async with House(tmp_path) as house:
            lab, token = house.supervisor.labs["anna"], house.tokens["anna"].act
            lab.state = ClassLabState.WAITING
            status, head, body = await house.ask("/anna/", token=token)
            assert (status, "Retry-After: 2" in head, b"it is the next" in body) == (503, True, True)
            body = (await house.ask("/anna/", token=token, Accept="text/html"))[2]
            assert b"refresh" in body and b"Anna &lt;b&gt;" in body
            lab.state, lab.reason, lab.failures = ClassLabState.FAILED, "it used 3 GB", MAX_FAILURES
            assert b"it used 3 GB. The instructor can start it again" in (await house.ask("/anna/", token=token))[2]
            # Whoever asks for its WebSocket is told so, too.
            assert (await house.ask("/anna/lab", token=token, **UPGRADE))[0] == 503

    run(check())


def test_a_dead_lab_costs_its_client_alone(tmp_path, monkeypatch):
    monkeypatch.setattr(passing, "ANSWER_S", 0.2)

    async def silent(reader, writer):
        await reader.read()

    async def no_http(reader, writer):
        writer.write(b"SSH-2.0-x\r\n\r\n")

    async def gone(reader, writer):
        await reader.readuntil(b"\r\n\r\n")
        writer.close()

    async def check(lab):
        async with House(tmp_path, lab) as house:
            for more in ({}, UPGRADE):
                status, _, body = await house.ask("/anna/", token=house.tokens["anna"].act, **more)
                assert status == 502 and b"the lab does not answer" in body
            (tmp_path / "anna").unlink(missing_ok=True)
            assert (await house.ask("/anna/", token=house.tokens["anna"].act))[0] == 502
            lab = house.supervisor.labs["anna"]
            assert (lab.busy, lab.sockets) == (0, 0)

    for lab in (silent, no_http, gone):
        run(check(lab))


def test_a_body_arrives_whole_and_has_a_limit(tmp_path):
    async def count(reader, writer):
        head = await reader.readuntil(b"\r\n\r\n")
        length = int(next(line for line in head.split(b"\r\n") if line.startswith(b"Content-Length:")).split()[1])
        data = await reader.readexactly(length)
        text = b"%d %d" % (len(data), data.count(b"a"))
        writer.write(b"HTTP/1.0 200 OK\r\nContent-Length: %d\r\n\r\n" % len(text) + text)
        writer.close()

    async def check():
        async with House(tmp_path, count) as house:
            token = house.tokens["anna"].act
            body = b"ab" * (4 << 20)
            assert (await house.ask("/anna/upload", "PUT", token, body))[2] == b"8388608 4194304"
            assert (await house.ask("/anna/upload", "PUT", token, **{
                "Content-Length": str(passing.LARGEST_BODY + 1)}))[0] == 413
            assert (await house.ask("/anna/upload", "PUT", token, **{"Transfer-Encoding": "chunked"}))[0] == 411

    run(check())


async def _sent_until_full(writer):
    """How many bytes a connection takes before it takes no more."""
    sent, chunk = 0, b"x" * 65536
    while sent < LARGE:
        writer.write(chunk)
        sent += len(chunk)
        try:
            async with asyncio.timeout(1.0):
                await writer.drain()
        except TimeoutError:
            return sent
    return sent


def test_a_lab_that_does_not_read_holds_its_client_up(tmp_path, monkeypatch):
    """And not the front door's memory: 20 students who send 32 MB each would take 640 MB."""
    monkeypatch.setattr(passing, "LARGEST_BODY", 2 * LARGE)
    end = asyncio.Event()

    monkeypatch.setattr(passing, "ANSWER_S", 2.0)

    async def deaf(reader, writer):
        await end.wait()
        writer.close()

    async def check():
        async with House(tmp_path, deaf) as house:
            reader, writer = await house.connect("/anna/upload", "PUT", house.tokens["anna"].act,
                                                 **{"Content-Length": str(2 * LARGE)})
            assert await _sent_until_full(writer) < LARGE // 2
            # In the end the request is given up, and does not count any more.
            await until(lambda: house.supervisor.labs["anna"].busy == 0)
            with contextlib.suppress(ConnectionError):
                assert await reader.read() == b""
            writer.transport.abort()
            end.set()

    run(check())


def test_slow_uploads_count_from_their_first_byte_to_their_end(tmp_path, monkeypatch):
    monkeypatch.setattr(front_door, "MAX_AT_ONCE", 3)

    async def upload(reader, writer):
        head = await reader.readuntil(b"\r\n\r\n")
        if b"PUT" in head:
            # One is given up half-way. An error that nobody takes is printed as the task is collected, in any test.
            with contextlib.suppress(asyncio.IncompleteReadError):
                await reader.readexactly(4)
        writer.write(ANSWER)
        writer.close()

    async def check():
        async with House(tmp_path, upload) as house:
            lab, token = house.supervisor.labs["anna"], house.tokens["anna"].act
            slow = [await house.connect("/anna/upload", "PUT", token, **{"Content-Length": "4", "Connection": "close"})
                    for _ in range(3)]
            await until(lambda: lab.busy == 3)
            assert (await house.ask("/anna/", token=token))[0] == 429
            slow[0][1].transport.abort()
            await until(lambda: lab.busy == 2)
            assert (await house.ask("/anna/", token=token))[0] == 200
            for reader, writer in slow[1:]:
                writer.write(b"body")
                assert (await reader.read()).endswith(b"hello")
            assert lab.busy == 0
        # From Python 3.13 on the server itself removes its socket.
        (tmp_path / "anna").unlink(missing_ok=True)
        async with House(tmp_path) as house:
            assert (await house.ask("/anna/", token=house.tokens["anna"].act))[0] == 502
            assert house.supervisor.labs["anna"].busy == 0

    run(check())


def test_a_slow_reader_holds_its_lab_up(tmp_path):
    """A video that nobody reads fills no memory, and a lab that answers another one goes on."""
    sent = []

    async def video(reader, writer):
        head = await reader.readuntil(b"\r\n\r\n")
        if b"/video" not in head:
            writer.write(ANSWER)
            writer.close()
            return
        writer.write(b"HTTP/1.0 200 OK\r\n\r\n")
        sent.append(await _sent_until_full(writer))

    async def check():
        async with House(tmp_path, video) as house:
            token = house.tokens["anna"].act
            _, slow = await house.connect("/anna/video", token=token)
            await until(lambda: sent)
            assert sent[0] < LARGE // 2
            assert (await house.ask("/anna/", token=token))[0] == 200
            slow.transport.abort()
            await until(lambda: house.supervisor.labs["anna"].busy == 0)

    run(check())


async def echo(reader, writer):
    await reader.readuntil(b"\r\n\r\n")
    writer.write(UPGRADED)
    while chunk := await reader.read(65536):
        writer.write(chunk)
    writer.close()


async def opened(house):
    reader, writer = await house.connect("/anna/lab", token=house.tokens["anna"].act, **UPGRADE)
    head = await reader.readuntil(b"\r\n\r\n")
    assert head.startswith(b"HTTP/1.1 101 ") and b"Sec-Websocket-Accept: k" in head
    return reader, writer


def test_a_websocket_goes_both_ways_and_ends_with_either_side(tmp_path):
    async def check():
        async with House(tmp_path, echo) as house:
            lab = house.supervisor.labs["anna"]
            reader, writer = await opened(house)
            assert (lab.sockets, lab.busy) == (1, 0)
            data = OPERATION + bytes(range(256)) * 1000
            writer.write(data)
            assert await reader.readexactly(len(data)) == data
            writer.close()
            await until(lambda: lab.sockets == 0)

    async def ends(reader, writer):
        await reader.readuntil(b"\r\n\r\n")
        writer.write(UPGRADED + b"last")
        writer.close()

    async def check_end():
        async with House(tmp_path, ends) as house:
            reader, _ = await opened(house)
            assert await reader.read() == b"last"
            assert house.supervisor.labs["anna"].sockets == 0

    run(check())
    (tmp_path / "anna").unlink(missing_ok=True)
    run(check_end())


def test_an_operation_wakes_a_paused_lab_and_a_heartbeat_does_not(tmp_path):
    heard = bytearray()

    async def listen(reader, writer):
        await reader.readuntil(b"\r\n\r\n")
        writer.write(UPGRADED)
        while chunk := await reader.read(65536):
            heard.extend(chunk)

    async def check():
        async with House(tmp_path, listen) as house:
            _, writer = await opened(house)
            labs = house.supervisor.labs
            labs.pause("anna", 0.0)
            asked = len(house.supervisor.requests)
            writer.write(BEAT)
            await writer.drain()
            await asyncio.sleep(0)  # whatever comes next is in a read of its own, or behind the heartbeat

            def is_heard():
                writer.write(OPERATION)
                return heard

            await until(is_heard)
            assert labs["anna"].state is ClassLabState.RUNNING and len(house.supervisor.requests) > asked
            assert heard.startswith((OPERATION, BEAT + OPERATION))

    run(check())


def test_a_lab_has_a_limit_of_connections(tmp_path, monkeypatch):
    """So that one student's pages do not take the descriptors of all."""
    monkeypatch.setattr(front_door, "MAX_AT_ONCE", 3)

    async def check():
        async with House(tmp_path, echo) as house:
            clients = [await opened(house) for _ in range(3)]
            status, _, body = await house.ask("/anna/lab", token=house.tokens["anna"].act, **UPGRADE)
            assert status == 429 and b"close some" in body
            clients[0][1].close()
            await until(lambda: house.supervisor.labs["anna"].sockets == 2)
            await opened(house)

    run(check())


def test_what_is_no_request_for_a_lab(tmp_path):
    async def check():
        async with House(tmp_path, hello) as house:
            status, head, _ = await house.ask("/anna", token=house.tokens["anna"].act)
            assert status == 302 and "Location: /anna/?token=" in head
            assert (await house.ask("/"))[0] == 404
            reader, writer = await house.connect("/anna/%s" % ("x" * 70000), token=house.tokens["anna"].act)
            assert b" 200 " not in await reader.read()
            writer.close()
            assert (await house.ask("/anna/?token=%ff"))[0] in (400, 403)
            assert (await house.ask("/anna/", token=house.tokens["anna"].act))[0] == 200

    async def check_heads():
        async with House(tmp_path, hello) as house:
            reader, writer = await asyncio.open_connection("127.0.0.1", house.port)
            writer.write(b"\x00\xff not http \r\n\r\n")
            await reader.read()
            writer.close()
            assert (await house.ask("/anna/", token=house.tokens["anna"].act))[0] == 200

    run(check())
    (tmp_path / "anna").unlink(missing_ok=True)
    run(check_heads())


def test_the_cookie_of_the_door_does_not_reach_the_lab(tmp_path):
    heads = []

    async def keep(reader, writer):
        heads.append(await reader.readuntil(b"\r\n\r\n"))
        writer.write(ANSWER)
        writer.close()

    async def check():
        async with House(tmp_path, keep) as house:
            token = house.tokens["anna"].act
            await house.ask("/anna/x", Cookie="a=1; %s=%s" % (front_door.COOKIE, token))
            assert token.encode() not in heads[0] and b"Cookie: a=1\r\n" in heads[0]

    run(check())


def test_an_open_jupyterlab_that_nobody_touches_wakes_no_lab_and_keeps_none_awake(tmp_path):
    polls = ("kernels?1", "sessions", "terminals", "contents?content=1&hash=0&7", "contents/notebooks?content=1")

    async def check():
        async with House(tmp_path, hello) as house:
            token, lab = house.tokens["anna"].act, house.supervisor.labs["anna"]
            for name in polls:
                assert (await house.ask("/anna/notebook/api/" + name, Cookie="lab_token=" + token))[0] == 200
            assert house.supervisor.requests == [] and (lab.busy, lab.sockets) == (0, 0)
            lab.state = ClassLabState.PAUSED
            for name in polls:
                assert (await house.ask("/anna/notebook/api/" + name, Cookie="lab_token=" + token))[0] == 409
            assert lab.state is ClassLabState.PAUSED
            assert (await house.ask("/anna/notebook/api/kernels"))[0] == 403
            await house.ask("/anna/notebook/api/contents/a.ipynb?type=notebook&content=1", Cookie="lab_token=" + token)
            assert lab.state is ClassLabState.RUNNING
            lab.state = ClassLabState.PAUSED
            await house.ask("/anna/notebook/api/kernels", "POST", Cookie="lab_token=" + token)
            assert lab.state is ClassLabState.RUNNING

    run(check())
