# SPDX-License-Identifier: BSD-3-Clause
"""The limits for clients without a token: memory, connections, time."""
import contextlib
import errno
import socket

import pytest
from tornado import web

from lab_testing.waiting import stretched, wait_until
from web_bridge import serving
from web_bridge.loop_thread import LoopThread


class Hello(web.RequestHandler):
    def get(self):
        self.finish("hello")

    post = get


class Served:
    def __init__(self, idle_s=serving.IDLE_S):
        self.loop = LoopThread()
        self.serving = serving.Serving(self.loop, web.Application([("/", Hello)]), 0, "127.0.0.1", idle_s=idle_s)
        self.sockets = []

    def connect(self, text=b""):
        connected = socket.create_connection(("127.0.0.1", self.serving.port), timeout=stretched(90))
        self.sockets.append(connected)
        connected.sendall(text)
        return connected

    def answer(self, head, body=b""):
        connected = self.connect(head.encode() + b" HTTP/1.1\r\nHost: localhost\r\n" + body)
        # A server that refuses a body may close before it has read it.
        with contextlib.suppress(ConnectionResetError):
            return connected.recv(4096)
        return b""

    def close(self):
        for connected in self.sockets:
            connected.close()
        self.serving.close()
        self.loop.stop()


@pytest.fixture
def served():
    made = Served()
    yield made
    made.close()


def test_the_first_free_port_is_held_from_then_on():
    taken = serving.first_sockets([0], "127.0.0.1")
    number = serving.port_of(taken)
    try:
        others = serving.first_sockets([number, 0], "127.0.0.1")
        assert serving.port_of(others) != number
        others[0].close()
        with pytest.raises(OSError) as refused:
            serving.first_sockets([number], "127.0.0.1")
        assert refused.value.errno == errno.EADDRINUSE
    finally:
        taken[0].close()
    loop = LoopThread()
    made = serving.Serving(loop, web.Application([]), 1, "", sockets=serving.first_sockets([number], "127.0.0.1"))
    assert made.port == number
    made.close()
    loop.stop()


def test_a_large_body_is_refused_before_it_is_read(served):
    """The client has sent the head alone: a server that reads the body would wait for it."""
    assert served.answer("POST /", b"Content-Length: 100000000\r\n\r\n").startswith(b"HTTP/1.1 400")
    assert b"hello" in served.answer("POST /", b"Content-Length: 3\r\n\r\nabc")


def test_a_large_body_in_chunks_is_refused(served):
    chunk = b"%x\r\n" % serving.LARGEST_BODY + b"x" * serving.LARGEST_BODY + b"\r\n"
    answer = served.answer("POST /", b"Transfer-Encoding: chunked\r\n\r\n" + chunk + chunk)
    assert b"hello" not in answer


@pytest.mark.parametrize("text", [b"", b"GET / HTTP/1.1\r\nHost: ",
                                  b"POST / HTTP/1.1\r\nHost: a\r\nContent-Length: 9\r\n\r\nx"])
def test_a_connection_without_a_complete_request_is_closed(text):
    served = Served(idle_s=0.2)
    try:
        assert served.connect(text).recv(4096) == b""
    finally:
        served.close()


def test_connections_that_say_nothing_keep_nobody_out(served, monkeypatch):
    monkeypatch.setattr(serving, "MAX_CONNECTIONS", 3)
    silent = [served.connect() for _ in range(3)]
    request = b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n"
    asking = served.connect(request)
    assert b"hello" in asking.recv(4096)
    assert silent[0].recv(4096) == b""
    # The others are still connected, and so is the new one.
    for connected in (*silent[1:], asking):
        connected.sendall(request)
        assert b"hello" in connected.recv(4096)


def test_connections_that_have_ended_do_not_count(served, monkeypatch):
    monkeypatch.setattr(serving, "MAX_CONNECTIONS", 3)
    silent = served.connect()
    for _ in range(5):
        # Closed by the server, one after the other.
        ending = served.connect(b"GET / HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n")
        while ending.recv(4096):
            pass
        wait_until(lambda: len(served.serving._server._streams) == 1, "the end of the connection")
    silent.sendall(b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n")
    assert b"hello" in silent.recv(4096)
