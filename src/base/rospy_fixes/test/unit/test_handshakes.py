# SPDX-License-Identifier: BSD-3-Clause
"""Reading handshakes on real sockets: quick and slow clients, silent ones, wrong ones, and too many."""
import errno
import os
import resource
import socket
import struct
import threading

import pytest

from lab_testing.waiting import wait_until
from rospy_fixes.ports import handshakes, limits
from rospy_fixes.ports.event_log import MAX_KINDS, PERIOD_S, EventLog
from rospy_fixes.ports.handshakes import HandshakeServer
from rospy_fixes.ports.tcpros_server import LONGEST_REASON, connection_handler
from rospy_fixes.ports.threads import ThreadFaults


class Clock:
    now = 0.0

    def __call__(self):
        return self.now


def framed(data):
    return struct.pack("<I", len(data)) + data


class Scene:
    """A server whose turns the test calls, and its clients."""

    def __init__(self):
        self.clock = Clock()
        self.listener = socket.create_server(("127.0.0.1", 0), backlog=512)
        self.served, self.lines, self.clients = [], [], []
        self.events = EventLog(self.lines.append, self.clock)
        self.faults = ThreadFaults(self.events)
        self.serve_by(lambda *served: self.served.append(served))

    def serve_by(self, serve):
        self.server = HandshakeServer(self.listener, serve, self.events, self.faults, self.clock)

    def connect(self, data=b""):
        client = socket.create_connection(self.listener.getsockname())
        self.clients.append(client)
        client.sendall(data)
        return client

    def turn_until(self, condition, what):
        wait_until(lambda: (self.server.turn(0.0), condition())[1], what, 60.0, 0.0)

    def headers(self):
        return [data[4:] for _, _, data in self.served]

    def close(self):
        for each in [*self.clients, *(connection for connection, _, _ in self.served), self.listener]:
            each.close()


@pytest.fixture
def scene():
    scene = Scene()
    yield scene
    scene.close()


def is_closed(client):
    """Whether the server has closed the connection (and sent its answer)."""
    try:
        client.setblocking(False)
        return client.recv(1) == b""
    except BlockingIOError:
        return False
    except ConnectionResetError:
        return True


def test_a_header_comes_whole_with_what_follows_left_in_the_socket(scene):
    client = scene.connect(framed(b"hello") + b"request")
    scene.turn_until(lambda: scene.served, "the client to be served")
    connection, address, data = scene.served[0]
    assert data == framed(b"hello")
    assert address[:2] == client.getsockname()
    assert connection.gettimeout() is None
    assert connection.recv(100) == b"request"
    assert scene.server.pending == 0


def test_a_header_byte_by_byte_holds_up_nobody(scene):
    slow, data = scene.connect(), framed(b"slow")
    for count in range(len(data)):
        slow.sendall(data[count:count + 1])
        scene.connect(framed(b"quick %d" % count))
        scene.turn_until(lambda count=count: b"quick %d" % count in scene.headers(), "a quick client")
    scene.turn_until(lambda: b"slow" in scene.headers(), "the slow one")


def test_five_hundred_silent_clients_hold_up_nobody_and_are_closed_in_time(scene):
    silent = []
    for _ in range(500):
        silent.append(scene.connect())
        scene.server.turn(0.0)
    scene.connect(framed(b"me"))
    scene.turn_until(lambda: scene.served, "the client that speaks")
    assert scene.server.pending == limits.HANDSHAKES_PER_ADDRESS
    # The oldest were closed for the newest.
    wait_until(lambda: all(map(is_closed, silent[:500 - limits.HANDSHAKES_PER_ADDRESS])), "the oldest to be closed")
    assert not is_closed(silent[-1])
    scene.clock.now += limits.HANDSHAKE_S
    scene.turn_until(lambda: scene.server.pending == 0, "all silent ones to be dropped")
    wait_until(lambda: all(map(is_closed, silent)), "all silent ones to be closed")
    assert len(scene.lines) == 1 and "127.0.0.1" in scene.lines[0]


def test_who_sends_a_byte_now_and_then_gets_no_more_time(scene):
    slow = scene.connect()
    while scene.clock.now < limits.HANDSHAKE_S:
        assert not is_closed(slow)
        slow.setblocking(True)
        slow.sendall(b"\x01")
        scene.server.turn(0.0)
        scene.clock.now += 4.0
    scene.turn_until(lambda: is_closed(slow), "the slow client to be closed")


def test_the_number_of_silent_clients_is_counted_by_address(scene, monkeypatch):
    monkeypatch.setattr(limits, "HANDSHAKES_PER_ADDRESS", 2)
    scene.listener.close()
    scene.listener = socket.create_server(("0.0.0.0", 0))
    scene.serve_by(lambda *served: None)
    port = scene.listener.getsockname()[1]
    other = socket.create_connection(("127.0.0.1", port), source_address=("127.0.0.2", 0))
    scene.clients.append(other)
    many = [socket.create_connection(("127.0.0.1", port)) for _ in range(5)]
    scene.clients += many
    scene.turn_until(lambda: all(map(is_closed, many[:3])), "three to be closed")
    assert not any(map(is_closed, [*many[3:], other]))


@pytest.mark.parametrize("data, said", [(struct.pack("<I", 2**32 - 1), "4294967295 bytes"),
                                        (struct.pack("<I", limits.HEADER_BYTES + 1), str(limits.HEADER_BYTES)),
                                        (b"GET / HTTP/1.1\r\n\r\n", "no ROS client")])
def test_what_can_be_no_header_is_refused_by_its_length(scene, data, said):
    client = scene.connect(data)
    scene.turn_until(lambda: is_closed(client), "the connection to be closed")
    assert len(scene.lines) == 1 and said in scene.lines[0]
    assert not scene.served


def test_a_client_that_goes_in_its_handshake_costs_no_line_and_no_descriptor(scene):
    before = len(os.listdir("/proc/self/fd"))
    for _ in range(300):
        scene.connect(framed(b"half")[:5]).close()
        scene.server.turn(0.0)
    scene.turn_until(lambda: scene.server.pending == 0, "all to be gone")
    # What earlier tests have left to the garbage collector may go meanwhile, or a thread of theirs open something.
    wait_until(lambda: len(os.listdir("/proc/self/fd")) <= before, "no more descriptors than before")
    assert scene.lines == []


def test_open_connections_are_counted_by_address_until_they_are_closed(scene, monkeypatch):
    monkeypatch.setattr(limits, "CONNECTIONS_PER_ADDRESS", 3)
    for count in range(1, 4):
        scene.connect(framed(b"one"))
        scene.turn_until(lambda count=count: len(scene.served) == count, "a client to be served")
    too_many = scene.connect(framed(b"one"))
    scene.turn_until(lambda: is_closed(too_many), "the fourth to be refused")
    assert len(scene.lines) == 1 and "3" in scene.lines[0]
    scene.served[0][0].close()
    scene.connect(framed(b"again"))
    scene.turn_until(lambda: b"again" in scene.headers(), "a client in the place of one that has gone")


def test_without_descriptors_the_silent_ones_go_and_serving_goes_on(scene):
    silent = scene.connect()
    scene.turn_until(lambda: scene.server.pending == 1, "the silent client")
    scene.connect(framed(b"me"))
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    # No descriptor below the highest is free, and none above it is allowed.
    highest = max(int(name) for name in os.listdir("/proc/self/fd"))
    fillers = [os.dup(scene.listener.fileno())]
    while fillers[-1] < highest:
        fillers.append(os.dup(scene.listener.fileno()))
    resource.setrlimit(resource.RLIMIT_NOFILE, (fillers[-1] + 1, hard))
    try:
        scene.turn_until(lambda: scene.lines, "the line about it")
        assert len(scene.lines) == 1 and os.strerror(errno.EMFILE) in scene.lines[0]
        assert scene.server.pending == 0 and not scene.served
        for _ in range(3):
            scene.server.turn(0.0)
        assert len(scene.lines) == 1
        scene.clock.now += handshakes.PAUSE_S
        scene.turn_until(lambda: scene.served, "the client that speaks, in its place")
        assert is_closed(silent)
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
        for filler in fillers:
            os.close(filler)


def test_what_cannot_be_served_costs_its_connection_and_no_other(scene):
    def serve(connection, address, data):
        if b"evil" in data:
            raise ZeroDivisionError("an error that nobody foresaw")
        scene.served.append((connection, address, data))

    scene.serve_by(serve)
    evil, slow = scene.connect(framed(b"evil")), scene.connect(framed(b"evil too")[:5])
    scene.turn_until(lambda: is_closed(evil) and scene.server.pending == 1, "the first to be closed")
    slow.setblocking(True)
    slow.sendall(framed(b"evil too")[5:])
    scene.turn_until(lambda: is_closed(slow), "the second to be closed")
    scene.connect(framed(b"good"))
    scene.turn_until(lambda: scene.headers() == [b"good"], "the good one")
    assert scene.server.pending == 0
    (_, values), line = scene.faults.summary(), scene.lines[0]
    assert len(scene.lines) == 1 and "ZeroDivisionError" in line
    assert next(iter(values.values())).startswith("2, ")


def test_the_thread_goes_on_after_an_error_of_its_own(scene):
    errors, turn = [OSError(errno.EIO, "broken"), SystemExit(3)], scene.server.turn

    def turn_or_fail():
        if errors:
            raise errors.pop(0)
        turn()

    scene.server.turn = turn_or_fail
    thread = threading.Thread(target=scene.server.run)
    thread.start()
    scene.connect(framed(b"good"))
    wait_until(lambda: scene.headers() == [b"good"], "a client after the errors")
    scene.server.close()
    thread.join(60.0)
    assert not thread.is_alive() and "2 times" in scene.faults.summary()[0]


class Node:
    """The handlers of rospy's server."""

    def topic_connection_handler(self, connection, address, header):
        return "no topic here"

    def service_connection_handler(self, connection, address, header):
        return "no service %s" % header["service"]


@pytest.mark.parametrize("body", [
    struct.pack("<I", 2) + b"\xff=", struct.pack("<I", 5) + b"a=\xc3(", b"\x01", struct.pack("<I", 0),
    struct.pack("<I", 2**31) + b"a=b", struct.pack("<I", 3) + b"abc"])
def test_bytes_that_are_no_header_cost_their_connection_and_a_line(scene, body):
    take = connection_handler(scene.events)
    scene.serve_by(lambda *of_one: take(Node(), *of_one))
    client = scene.connect(framed(body))
    scene.turn_until(lambda: is_closed(client), "the client to be closed")
    assert len(scene.lines) == 1 and scene.faults.summary() is None and scene.lines[0].isprintable()


def test_a_client_that_does_not_read_its_long_refusal_holds_up_nobody(scene):
    take = connection_handler(scene.events)
    scene.serve_by(lambda *of_one: take(Node(), *of_one))
    text = b"service=\x1b[31m" + 200_000 * b"a"
    client = scene.connect(framed(struct.pack("<I", len(text)) + text))
    client.setblocking(True)
    scene.turn_until(lambda: scene.lines, "the line")
    assert len(client.recv(300_000, socket.MSG_WAITALL)) < LONGEST_REASON + 100
    assert len(scene.lines[0]) < 2000 and scene.lines[0].isprintable()


def test_kinds_of_events_that_others_can_invent_are_forgotten():
    log = EventLog([].append)
    for number in range(3 * MAX_KINDS):
        log.add(("refused", number), "refused")
    assert len(log._kinds) <= MAX_KINDS


def test_one_kind_of_event_costs_one_line_a_minute_with_their_number():
    lines, clock = [], Clock()
    log = EventLog(lines.append, clock)
    for _ in range(500):
        log.add("idle", "closed")
    log.add("other", "refused")
    assert lines == ["closed", "refused"]
    clock.now += PERIOD_S
    log.add("idle", "closed")
    assert lines[2] == "closed (and 499 more since the last line about it)"
