# SPDX-License-Identifier: BSD-3-Clause
"""The page's files and its socket on a live server; another implementation is the client."""
import json
import re
import urllib.error
import urllib.request
from pathlib import Path

import pytest
import websocket
from tornado import web

from lab_testing.waiting import stretched, wait_until
from lab_web.playback import MotionRecorder
from lab_web.scene import SceneText
from lab_web.serving import Pages, policy, routes, upload_routes
from web_bridge.access import Access
from web_bridge.loop_thread import LoopThread
from web_bridge.serving import Serving

PAGE = Path(__file__).resolve().parents[2] / "page"
SHAPE = "0123456789abcdef01234567"


class FakeLab:
    holder = None

    def __init__(self):
        self.served = []
        self.left = []
        self.beats = []

    def serve(self, client, may_act, operation):
        self.served.append((client, may_act, operation))

    def beat(self, client, page_answers=True):
        self.beats.append(page_answers)

    def gone(self, client):
        self.left.append(client)


class Server:
    def __init__(self, libraries):
        (libraries / "three").mkdir()
        (libraries / "three" / "LICENSE").write_text("MIT")
        self.loop = LoopThread()
        self.pages = Pages(Access({"drive": True, "look": False}, names=[]), self.loop, FakeLab())
        self.recorder = MotionRecorder(lambda state: None)
        self.serving = Serving(self.loop, web.Application(
            [*routes(self.pages, PAGE, libraries), *upload_routes(self.pages, self.recorder)]), 0, "127.0.0.1")

    def get(self, path):
        address = "http://127.0.0.1:%d%s" % (self.serving.port, path)
        with urllib.request.urlopen(address, timeout=stretched(90)) as answer:
            return answer.headers, answer.read()

    def connect(self, token="drive", **options):
        return websocket.create_connection("ws://127.0.0.1:%d/lab?token=%s" % (self.serving.port, token),
                                           timeout=stretched(90), **options)

    def close(self):
        self.serving.close()
        self.loop.stop()


@pytest.fixture
def server(tmp_path):
    made = Server(tmp_path)
    yield made
    made.close()


def until(socket, condition):
    while True:
        frame = socket.recv()
        if not isinstance(frame, str):
            continue
        operation = json.loads(frame)
        if condition(operation):
            return operation


@pytest.mark.parametrize("path", ["/", "/?token=wrong", "/scene", "/scene/" + SHAPE, "/lab"])
def test_nothing_of_the_lab_is_served_without_the_token(server, path):
    server.pages.picture = SceneText(1, "{}", {SHAPE: b"abc"})
    with pytest.raises(urllib.error.HTTPError) as refused:
        server.get(path)
    assert refused.value.code == 403


@pytest.mark.parametrize("token", ["drive", "look"])
def test_the_page_comes_with_either_token_and_may_run_no_foreign_script(server, token):
    headers, body = server.get("/?token=" + token)
    text = (PAGE / "index.html").read_text(encoding="utf-8")
    assert body.decode() == text and headers["Content-Security-Policy"] == policy(text)
    assert "script-src 'self' 'sha256-" in policy(text) and "unsafe" not in policy(text)
    assert not re.search(r"https?://|//cdn", text)


def test_files_outside_of_the_page_are_not_served(server):
    assert server.get("/page/main.js") and server.get("/three/LICENSE")[1] == b"MIT"
    for path in ("/page/../package.xml", "/page/%2e%2e/package.xml", "/three/..%2f..%2fetc/passwd", "/page/main.js%00"):
        with pytest.raises(urllib.error.HTTPError, match="40[34]"):
            server.get(path)


def test_shapes_and_poses(server):
    with pytest.raises(urllib.error.HTTPError, match="404"):
        server.get("/scene?token=look")
    picture = SceneText(3, '{"revision": 3}', {SHAPE: b"abcd"})
    server.pages.show_poses(picture, b"first")
    assert json.loads(server.get("/scene?token=look")[1]) == {"revision": 3}
    assert server.get("/scene/%s?token=look" % SHAPE)[1] == b"abcd"
    with pytest.raises(urllib.error.HTTPError, match="404"):
        server.get("/scene/%s?token=look" % SHAPE[::-1])
    socket = server.connect("look")
    frames = iter(socket.recv, None)
    assert next(frame for frame in frames if isinstance(frame, bytes)) == b"first"
    server.pages.show_poses(picture, b"second")
    assert next(frame for frame in frames if isinstance(frame, bytes)) == b"second"


@pytest.mark.parametrize(("token", "may_act"), [("drive", True), ("look", False)])
def test_a_page_learns_what_it_may_do_and_its_operations_arrive(server, token, may_act):
    server.pages.share("robot", {"joints": [], "poses": ["neutral"]})
    socket = server.connect(token)
    assert until(socket, lambda operation: operation["op"] == "hello")["may_act"] is may_act
    assert until(socket, lambda operation: operation["op"] == "robot")["poses"] == ["neutral"]
    assert until(socket, lambda operation: operation["op"] == "control") == {
        "op": "control", "mine": False, "free": True, "pages": 1}
    socket.send("beat")
    socket.send("busy")
    socket.send('{"op": "stop"}')
    wait_until(lambda: server.pages.lab.served, "the operation")
    (client, acts, operation), = server.pages.lab.served
    assert (acts, operation, server.pages.lab.beats) == (may_act, {"op": "stop"}, [True, False])
    server.pages.lab.holder = client
    server.pages.control_changed()
    assert until(socket, lambda operation: operation["op"] == "control" and operation["mine"])
    socket.close()
    wait_until(lambda: server.pages.lab.left == [client], "the end of the page")


@pytest.mark.parametrize("frame", ["[]", "{", "3", "[" * 60000, '"stop"', '{"op": "%s"}' % ("x" * 70000)])
def test_a_frame_that_is_no_operation_is_answered_and_the_page_stays(server, frame):
    socket = server.connect()
    socket.send(frame)
    assert until(socket, lambda operation: operation["op"] == "told")["code"] == "unknown"
    server.pages.tell(None, "stopped", "for all")
    assert until(socket, lambda operation: operation["op"] == "told")["text"] == "for all"
    assert server.pages.lab.served == []


@pytest.mark.parametrize("options", [{"token": "wrong"}, {"token": ""}, {"origin": "http://pages.example"},
                                     {"origin": "null"}])
def test_foreign_pages_and_wrong_tokens_do_not_connect(server, options):
    with pytest.raises(websocket.WebSocketBadStatusException, match="403"):
        server.connect(**options)


def upload(server, token, content, origin=None, path="screen", page="7"):
    request = urllib.request.Request(
        "http://127.0.0.1:%d/%s?token=%s&page=%s" % (server.serving.port, path, token, page), content,
        {} if origin is None else {"Origin": origin})
    with urllib.request.urlopen(request, timeout=stretched(20)) as answer:
        return answer.status


@pytest.mark.parametrize("page", ["", "-1", "x", "9" * 5000, "%C2%B2"])
def test_a_number_that_no_page_has_is_no_fault_of_the_server(server, page):
    assert upload(server, "drive", b"x", page=page) == 204
    assert [client for client, *_ in server.pages.lab.served] == [0]


def test_a_request_that_fails_leaves_no_token_in_the_log(server, caplog):
    def serve(*_):
        raise RuntimeError("at /screen?token=drive")
    server.pages.lab.serve = serve
    for page, status in (("7", 500), ("%ff", 400)):
        with pytest.raises(urllib.error.HTTPError, match=str(status)) as caught:
            upload(server, "drive", b"x", page=page)
        assert "drive" not in caught.value.read().decode()
    assert "RuntimeError" in caplog.text and "/screen?token=…" in caplog.text and "drive" not in caplog.text


def test_a_picture_for_the_screen_is_an_operation_of_its_page(server):
    rows, beats = bytes(3 * 1024 * 600), []
    lab = server.pages.lab
    # A page that was busy with its picture has been silent: what it sends is a sign of life, before the operation.
    lab.beat = lambda client: beats.append((client, list(lab.served)))
    assert upload(server, "drive", rows) == 204
    assert beats == [(7, [])]
    assert lab.served == [(7, True, {"op": "screen", "content": rows})]


@pytest.mark.parametrize("how", [{"token": "wrong"}, {"token": "look"}, {"token": "drive", "origin": "http://pages.example"}])
def test_strangers_and_watchers_show_no_picture(server, how):
    with pytest.raises(urllib.error.HTTPError, match="403"):
        upload(server, content=b"rgb", **how)
    assert server.pages.lab.served == []


def test_a_recording_goes_up_and_comes_down(server):
    assert upload(server, "drive", b"time,left_s0\n0,0.5\n1,0.25\n", path="recording") == 204
    (client, may_act, operation), = server.pages.lab.served
    assert (client, may_act, operation["op"], operation["content"].at(0.5)) == (7, True, "load", {"left_s0": 0.375})
    with pytest.raises(urllib.error.HTTPError, match="404"):
        server.get("/recording.csv?token=look")
    server.recorder.keep(operation["content"])
    headers, content = server.get("/recording.csv?token=look")
    assert content == b"time,left_s0\n0.000000,0.500000\n1.000000,0.250000\n"
    assert "attachment" in headers["Content-Disposition"]


@pytest.mark.parametrize("content", [b"", b"\xff\xfe", b"PK\x00", b"time,tail\n0,1\n"])
def test_a_file_that_is_no_recording_is_told_to_its_page(server, content):
    told = []
    server.pages.tell = lambda *what: told.append(what)
    assert upload(server, "drive", content, path="recording") == 204
    assert server.pages.lab.served == [] and told[0][:2] == (7, "refused")


def test_a_file_that_is_too_large_is_not_read(server):
    with pytest.raises((urllib.error.URLError, ConnectionError)):
        upload(server, "drive", b"0" * (17 << 20), path="recording")
    assert server.pages.lab.served == []
    assert upload(server, "drive", b"rgb") == 204
