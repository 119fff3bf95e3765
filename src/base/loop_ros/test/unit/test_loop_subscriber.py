# SPDX-License-Identifier: BSD-3-Clause
"""Reading in the loop on real sockets: whole, torn, large and malformed messages, and every way to end."""
import contextlib
import socket
import struct
import threading

import pytest

from lab_testing.waiting import wait_until
from loop_ros import subscriber as subscribing
from loop_ros.subscriber import PublisherConnection, SubscriberHub

LARGEST_BYTES = 10_000_000


class Clock:
    """Advances by one poll period whenever it is read."""

    now = 0.0

    def __call__(self):
        self.now += subscribing.LOOK_PERIOD_S
        return self.now


class Line:
    """One publisher's connection to the hub, over TCP as the real one: ``far`` sends, ``got`` is what was delivered."""

    def __init__(self, hub):
        with socket.create_server(("127.0.0.1", 0)) as server:
            self.far = socket.create_connection(server.getsockname())
            self.near, _ = server.accept()
        self.got = []
        self.connection = PublisherConnection(self.near, self.got.append, LARGEST_BYTES)
        hub.add(self.connection)

    def close(self):
        self.far.close()
        self.near.close()


def framed(data):
    return struct.pack("<I", len(data)) + data


@pytest.fixture
def hub():
    hub = SubscriberHub(Clock())
    yield hub
    hub.close()


@pytest.fixture
def line(hub):
    line = Line(hub)
    yield line
    line.close()


def serve_until(hub, condition, what):
    def served():
        hub.service()
        return condition()

    wait_until(served, what, 60.0, 0.0)


def test_messages_come_whole_and_in_order(hub, line):
    sent = [b"one", b"", b"three" * 100]
    line.far.sendall(b"".join(map(framed, sent)))
    serve_until(hub, lambda: len(line.got) == 3, "three messages")
    assert line.got == sent


def test_a_torn_message_waits_for_its_rest(hub, line):
    data = framed(b"first") + framed(b"second")
    for count in range(1, len(data)):
        line.far.sendall(data[:count])
        line.far.sendall(data[count:])
    serve_until(hub, lambda: len(line.got) == 2 * (len(data) - 1), "all messages")
    assert line.got == [b"first", b"second"] * (len(data) - 1)


def test_half_a_message_is_not_delivered(hub, line):
    line.far.sendall(framed(b"whole") + framed(b"half")[:6])
    serve_until(hub, lambda: line.got, "the whole one")
    for _ in range(5):
        hub.service()
    assert line.got == [b"whole"]
    line.far.sendall(framed(b"half")[6:])
    serve_until(hub, lambda: len(line.got) == 2, "the other half")
    assert line.got == [b"whole", b"half"]


def test_a_large_message_arrives_over_many_turns(hub, line):
    data = bytes(range(256)) * 12000  # a colour picture of 1024 x 1000
    sender = threading.Thread(target=line.far.sendall, args=(framed(data) + framed(b"next"),))
    sender.start()
    serve_until(hub, lambda: len(line.got) == 2, "the picture and what comes after it")
    sender.join()
    assert line.got == [data, b"next"]


def test_who_sends_more_than_a_turn_takes_neither_holds_up_the_loop_nor_others(hub, line):
    other, message = Line(hub), framed(b"x" * 50)
    sent = 0
    line.far.setblocking(False)
    with contextlib.suppress(BlockingIOError):
        while True:
            sent += line.far.send(message * 100)
    assert sent > 20 * subscribing.PORTION_BYTES
    other.far.sendall(framed(b"me too"))
    serve_until(hub, lambda: other.got, "the other one's message")
    # With the clock of these tests, a turn reads two portions of a connection.
    most = 2 * subscribing.PORTION_BYTES / len(message) + 1
    assert 0 < len(line.got) <= 2 * most
    before = len(line.got)
    hub.service()
    assert 0 < len(line.got) - before <= most
    serve_until(hub, lambda: len(line.got) == sent // len(message), "the rest")
    other.close()


def test_sockets_are_not_looked_at_more_often_than_said(line):
    clock = Clock()
    hub = SubscriberHub(lambda: clock.now)
    hub.add(line.connection)
    line.far.sendall(framed(b"early"))
    wait_until(lambda: len(line.near.recv(100, socket.MSG_PEEK)) == 9, "the message to arrive", 10.0)
    hub.service()
    assert line.got == [b"early"]
    line.far.sendall(framed(b"late"))
    wait_until(lambda: len(line.near.recv(100, socket.MSG_PEEK)) == 8, "the message to arrive", 10.0)
    clock.now += 0.9 * subscribing.LOOK_PERIOD_S
    hub.service()
    assert line.got == [b"early"]
    clock.now += 0.2 * subscribing.LOOK_PERIOD_S
    hub.service()
    assert line.got == [b"early", b"late"]


def test_reads_are_counted_by_turns_and_not_by_the_clock(line):
    hub = SubscriberHub(lambda: 0.0)
    hub.add(line.connection)
    for number in (1, 2, 3):
        hub.service()
        assert hub.reads == number
    # Who has hung up sends nothing, which is to be noticed as well.
    line.connection.end()
    hub.service()
    assert hub.reads == 4


def test_a_publisher_that_goes_ends_its_connection_and_no_other(hub, line):
    other = Line(hub)
    line.far.sendall(framed(b"last words"))
    line.far.close()
    serve_until(hub, line.connection.ended.is_set, "the end")
    assert line.got == [b"last words"]
    assert line.connection.fault == ""
    other.far.sendall(framed(b"still here"))
    serve_until(hub, lambda: other.got, "the other one")
    other.close()


def test_a_connection_closed_from_this_side_ends(hub, line):
    hub.service()
    # As rospy does it, in a separate thread; the number of the descriptor may then be given to another file at once.
    line.near.shutdown(socket.SHUT_RDWR)
    line.near.close()
    replacement = Line(hub)
    serve_until(hub, line.connection.ended.is_set, "the end")
    replacement.far.sendall(framed(b"new"))
    serve_until(hub, lambda: replacement.got, "the new one's message")
    assert line.got == []
    replacement.close()


@pytest.mark.parametrize("announced", [LARGEST_BYTES + 1, 10**9, 2**32 - 1])
def test_a_message_that_announces_too_much_ends_the_connection_with_size_and_limit(hub, line, announced):
    line.far.sendall(framed(b"fine") + struct.pack("<I", announced))
    serve_until(hub, line.connection.ended.is_set, "the end")
    assert line.got == [b"fine"]
    assert str(announced) in line.connection.fault and str(LARGEST_BYTES) in line.connection.fault


@pytest.mark.parametrize("held", [b"", framed(b"at once")])
def test_an_error_that_nobody_foresaw_ends_its_connection_and_no_other(hub, line, held):
    def fail(data):
        raise MemoryError("no room for %d bytes" % len(data))

    first, second = Line(hub), Line(hub)
    evil = PublisherConnection(line.near, fail, LARGEST_BYTES, held)
    hub.add(evil)
    line.connection.end()
    line.far.sendall(framed(b"later"))
    for good in (first, second):
        good.far.sendall(framed(b"good"))
    serve_until(hub, lambda: evil.ended.is_set() and first.got == second.got == [b"good"], "the good ones")
    assert "MemoryError" in evil.fault
    for good in (first, second):
        good.close()


def test_the_end_of_the_loop_ends_all(hub, line):
    hub.service()
    late = Line(hub)
    hub.close()
    assert line.connection.ended.is_set() and late.connection.ended.is_set()
    latest = Line(hub)
    assert latest.connection.ended.is_set()
    for each in (late, latest):
        each.close()
