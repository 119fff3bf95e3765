# SPDX-License-Identifier: BSD-3-Clause
"""Requests for JupyterLab through the page's server, with a small server in its place; the headers that reach it."""
import http.client
import json
import threading

import pytest
import websocket
from tornado import web
from tornado.httpserver import HTTPServer
from tornado.netutil import bind_unix_socket
from tornado.websocket import WebSocketHandler

from lab_testing.waiting import stretched, wait_until
from lab_web.jupyter import JupyterError
from lab_web.notebooks import NotebookDoor, NotebookHandler, Notebooks, labs_notebooks
from web_bridge.access import Access
from web_bridge.loop_thread import LoopThread
from web_bridge.serving import Serving

LARGE = 10 << 20


class Echo(WebSocketHandler):
    def initialize(self, asked):
        self._asked = asked

    def check_origin(self, origin):
        return True

    def open(self, *_):
        self._asked.append(self.request)

    def on_message(self, message):
        self.write_message(message, binary=isinstance(message, bytes))


class Anything(web.RequestHandler):
    def initialize(self, asked):
        self._asked = asked

    def get(self, *_):
        self._asked.append(self.request)
        self.set_header("X-Secret", "y")
        self.set_cookie("jupyter", "1", path="/anna/notebook/")
        if "redirected" in self.request.path:
            self.redirect("/anna/notebook/lab")
            return
        self.finish("jupyter's")

    def post(self, *_):
        self._asked.append(self.request)
        self.finish("%d" % len(self.request.body))

    put = patch = delete = post


class JupyterServer:
    """As lab_web.jupyter.Server; ``asked``: the requests that reached it."""

    def __init__(self, loop, path):
        self.has_ended = False
        self.asked, self._loop, self.path, self.socket = [], loop, path, None
        self._ended = threading.Event()
        loop.run(self._listen())

    async def _listen(self):
        routes = [(r"/anna/notebook/api/kernels/1/channels", Echo, {"asked": self.asked}),
                  (r"/.*", Anything, {"asked": self.asked})]
        self._server = HTTPServer(web.Application(routes), max_body_size=2 * LARGE)
        self._server.add_socket(bind_unix_socket(str(self.path)))

    def wait(self):
        self.socket = self.path

    def join(self):
        self._ended.wait()

    def close(self):
        self.has_ended = True
        self._ended.set()


class House:
    """A page's server below /anna; ``told``: the states that pages have been told."""

    def __init__(self, folder):
        self.loop, self.told, self.starts = LoopThread(), [], 0
        self._folder, self.jupyter = folder, None
        self.notebooks = Notebooks(self._start, ["a.ipynb"], self.told.append, "/anna")
        self.door = NotebookDoor(Access({"drive": True, "look": False}, names=[]), self.notebooks)
        self.serving = Serving(self.loop, web.Application([(r"/notebook/.*", NotebookHandler, {"door": self.door})]), 0,
                               "127.0.0.1")
        self.host = "127.0.0.1:%d" % self.serving.port
        self.cookie = "%s=%s" % (self.door.cookie, self.door.secret)

    def _start(self):
        self.starts += 1
        self.jupyter = JupyterServer(self.loop, self._folder / ("jupyter%d" % self.starts))
        return self.jupyter

    def start(self):
        self.notebooks.ask()
        wait_until(lambda: self.notebooks.socket, "the notebooks' server")
        return self

    def ask(self, path, method="GET", body=None, **headers):
        """(status, headers, body) of the answer; the path is sent as it is."""
        connection = http.client.HTTPConnection(self.host, timeout=stretched(60))
        try:
            connection.request(method, path, body, {name.replace("_", "-"): text for name, text in headers.items()})
            answer = connection.getresponse()
            return answer.status, answer.headers, answer.read().decode()
        finally:
            connection.close()

    def connect(self, query="", **options):
        return websocket.create_connection("ws://%s/notebook/api/kernels/1/channels%s" % (self.host, query),
                                           timeout=stretched(60), **options)

    def close(self):
        self.notebooks.close()
        self.serving.close()
        self.loop.stop()


@pytest.fixture
def house(tmp_path):
    made = House(tmp_path)
    yield made
    made.close()


@pytest.mark.parametrize(("query", "headers"), [
    ("", {}), ("?token=wrong", {}), ("?token=look", {}), ("", {"Authorization": "Bearer look"}),
    ("", {"Cookie": "lab_notebook_0=x"}), ("?token=wrong", {"Cookie": "the page's"})])
def test_nobody_without_the_operators_token_reaches_or_starts_it(house, query, headers):
    if "Cookie" in headers:
        headers = {"Cookie": headers["Cookie"].replace("the page's", house.cookie)}
    for method in ("GET", "POST", "DELETE"):
        assert house.ask("/notebook/api/contents" + query, method, **headers)[0] == 403
    assert house.starts == 0
    house.start()
    for method in ("GET", "POST", "PUT", "PATCH", "DELETE"):
        assert house.ask("/notebook/api/contents" + query, method, **headers)[0] == 403
    with pytest.raises(websocket.WebSocketBadStatusException, match="403"):
        house.connect(query, header=headers)
    assert house.jupyter.asked == []


def test_the_token_becomes_a_cookie_that_only_this_server_reads(house):
    house.start()
    status, headers, _ = house.ask("/notebook/lab/tree/a%20b.ipynb?token=drive&x=1%262")
    assert (status, headers["Location"]) == (302, "/notebook/lab/tree/a%20b.ipynb?x=1%262")
    assert headers["Set-Cookie"] == "%s; HttpOnly; Path=/anna/notebook/; SameSite=Strict" % house.cookie
    assert house.jupyter.asked == []
    status, headers, body = house.ask(headers["Location"], Cookie="other=1; " + house.cookie)
    assert (status, body) == (200, "jupyter's") and "X-Secret" not in headers
    assert headers["Set-Cookie"] == "jupyter=1; Path=/anna/notebook/"
    (asked,) = house.jupyter.asked
    assert asked.uri == "/anna/notebook/lab/tree/a%20b.ipynb?x=1%262"
    assert asked.headers["Cookie"] == "other=1" and house.door.secret not in str(asked.headers)


def test_its_own_redirects_lead_to_the_page_below_the_front_door(house):
    house.start()
    assert house.ask("/notebook/redirected", Cookie=house.cookie)[1]["Location"] == "/notebook/lab"


def test_a_program_uses_the_token_itself(house):
    house.start()
    assert house.ask("/notebook/api", "POST", b"x" * 7, Authorization="Bearer drive")[2] == "7"
    socket = house.connect("?token=drive")
    socket.send("hello")
    assert socket.recv() == "hello"
    socket.close()


@pytest.mark.parametrize("origin", ["http://example.org", "http://localhost:1", "http://127.0.0.1:1", "null"])
def test_a_foreign_page_is_refused_although_the_browser_sends_the_cookie(house, origin):
    """Another port of this host is another page, which may be somebody else's."""
    house.start()
    for method in ("GET", "POST", "PUT", "DELETE"):
        assert house.ask("/notebook/api/kernels", method, Cookie=house.cookie, Origin=origin)[0] == 403
    for site in ("same-site", "cross-site"):
        assert house.ask("/notebook/api/kernels", Cookie=house.cookie, Sec_Fetch_Site=site)[0] == 403
    with pytest.raises(websocket.WebSocketBadStatusException, match="403"):
        house.connect(cookie=house.cookie, origin=origin)
    assert house.jupyter.asked == []
    assert house.ask("/notebook/api", Cookie=house.cookie, Origin="http://" + house.host,
                     Sec_Fetch_Site="same-origin")[0] == 200


@pytest.mark.parametrize("path", [
    "/notebook/../api", "/notebook/%2e%2e/api", "/notebook/files/..%2f..%2fetc/passwd", "/notebook/./x",
    "/notebook/files/..%5c..%5cx", "/notebook/files/.%2e/x"])
def test_no_path_leads_out_of_the_notebooks(house, path):
    house.start()
    assert house.ask(path, Cookie=house.cookie)[0] == 404 and house.jupyter.asked == []


def test_a_web_socket_is_passed_on_in_both_directions(house):
    house.start()
    socket = house.connect(cookie=house.cookie, origin="http://" + house.host)
    for message in ("text", "x" * 100000):
        socket.send(message)
        assert socket.recv() == message
    socket.send_binary(b"\0\xff" * 70000)
    assert socket.recv() == b"\0\xff" * 70000
    socket.close()
    assert house.door.secret not in str(house.jupyter.asked[0].headers)


def test_a_large_notebook_is_saved_whole_and_a_larger_one_refused(house):
    house.start()
    assert house.ask("/notebook/api/contents/a", "PUT", b"x" * LARGE, Cookie=house.cookie)[2] == str(LARGE)
    assert house.ask("/notebook/api/contents/a", "PUT", Cookie=house.cookie,
                     Content_Length=str(64 << 20))[0] == 413


def test_the_first_request_starts_it_and_says_so(house):
    status, headers, body = house.ask("/notebook/lab", Cookie=house.cookie)
    assert (status, headers["Refresh"], body) == (503, "2", "JupyterLab is starting.\n")
    wait_until(lambda: house.notebooks.socket, "the notebooks' server")
    assert house.ask("/notebook/lab", Cookie=house.cookie)[0] == 200 and house.starts == 1
    assert [said["state"] for said in house.told] == ["off", "starting", "running"]
    assert house.told[-1]["files"] == ["a.ipynb"] and json.dumps(house.told)


def test_it_is_started_again_after_its_end_and_pages_can_tell(house):
    house.start()
    house.jupyter.close()
    wait_until(lambda: house.told[-1]["state"] == "failed", "the news of its end")
    assert house.told[-1]["why"] == "JupyterLab has ended"
    wait_until(lambda: house.notebooks.ask() or house.starts == 2, "another start")
    wait_until(lambda: house.told[-1]["state"] == "running", "the second server")
    first, second = (said["number"] for said in house.told if said["state"] == "running")
    assert first != second


def test_pages_are_told_why_it_does_not_start(house):
    def fail():
        raise JupyterError("no space")
    house.notebooks._start = fail
    house.notebooks.ask()
    wait_until(lambda: house.told[-1]["state"] == "failed", "the reason")
    assert house.told[-1]["why"] == "no space"


def test_nothing_starts_after_the_end(house):
    house.start()
    house.notebooks.close()
    assert house.jupyter.has_ended
    house.notebooks.ask()
    assert house.starts == 1


def test_the_labs_notebooks_are_copied_once_and_a_users_own_text_stays(tmp_path):
    (tmp_path / "source").mkdir()
    (tmp_path / "source" / "1_a.ipynb").write_text("given")
    root = tmp_path / "home"
    assert labs_notebooks({"rf_lab2": tmp_path / "source"}, root) == ["notebooks/rf_lab2/1_a.ipynb"]
    (root / "notebooks" / "rf_lab2" / "1_a.ipynb").write_text("mine")
    (tmp_path / "source" / "2_b.ipynb").write_text("new")
    assert labs_notebooks({"rf_lab2": tmp_path / "source"}, root)[1] == "notebooks/rf_lab2/2_b.ipynb"
    assert (root / "notebooks" / "rf_lab2" / "1_a.ipynb").read_text() == "mine"
