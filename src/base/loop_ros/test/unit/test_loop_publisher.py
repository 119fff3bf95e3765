# SPDX-License-Identifier: BSD-3-Clause
"""The loop's publisher on real sockets: partial writes, full peers, dead peers, late joiners."""
import contextlib
import socket
import struct

import pytest

from lab_testing.waiting import wait_until
from loop_ros import publisher as publishing
from loop_ros.publisher import STOPPED_RETRY_S, STOPPED_S, LoopPublisher, Peer, PublisherHub


class FakeTransport:
    """The connection that rospy hands over for one subscriber."""

    def __init__(self, impl):
        self._impl = impl
        self.socket, self.far = socket.socketpair()
        self.stat_bytes = self.stat_num_msg = 0

    def close(self):
        self._impl.connections = [other for other in self._impl.connections if other is not self]
        self.socket.close()

    def received(self):
        """Everything that has arrived, as a list of whole messages; fails on a torn one."""
        self.far.setblocking(False)
        data = b""
        with contextlib.suppress(BlockingIOError):
            while chunk := self.far.recv(1 << 20):
                data += chunk
        self.rest = getattr(self, "rest", b"") + data
        messages = []
        while len(self.rest) >= 4:
            length, = struct.unpack_from("<I", self.rest)
            if len(self.rest) < 4 + length:
                break
            messages.append(self.rest[4:4 + length])
            self.rest = self.rest[4 + length:]
        return messages


class FakeImpl:
    """rospy's side of a topic: a list that is replaced at every change."""

    def __init__(self):
        self.connections = []

    def connect(self):
        transport = FakeTransport(self)
        self.connections = [*self.connections, transport]
        return transport


class FakeMessage:
    """Serialises to its own bytes."""

    _has_header = False

    def __init__(self, content):
        self.content = content

    def serialize(self, buffer):
        buffer.write(self.content)


class FakeHeader:
    seq = 0


class FakeStamped(FakeMessage):
    _has_header = True

    def __init__(self):
        super().__init__(b"")
        self.header = FakeHeader()

    def serialize(self, buffer):
        buffer.write(b"seq %d" % self.header.seq)


@pytest.fixture
def impl():
    return FakeImpl()


@pytest.fixture
def hub():
    return PublisherHub()


def make(hub, impl, msg_class=FakeMessage, **options):
    publisher = LoopPublisher(hub, "/topic", msg_class, **options)
    publisher.attach(impl)
    return publisher


def test_every_peer_gets_every_message(hub, impl):
    publisher, peers = make(hub, impl), [impl.connect() for _ in range(3)]
    for text in (b"one", b"two"):
        publisher.publish(FakeMessage(text))
    for peer in peers:
        assert peer.received() == [b"one", b"two"]
        assert (peer.stat_num_msg, peer.stat_bytes) == (2, 14)


def test_a_shorter_message_after_a_longer_one_carries_nothing_of_it(hub, impl):
    publisher, peer = make(hub, impl), impl.connect()
    publisher.publish(FakeMessage(b"a long message"))
    publisher.publish(FakeMessage(b"short"))
    assert peer.received() == [b"a long message", b"short"]


def test_nothing_is_serialised_without_listeners(hub, impl):
    class Costly(FakeMessage):
        def serialize(self, buffer):
            raise AssertionError("serialised for nobody")

    publisher = make(hub, impl)
    assert not publisher.has_listeners
    publisher.publish(Costly(b""))


def test_before_registration_there_are_no_listeners(hub):
    publisher = LoopPublisher(hub, "/topic", FakeMessage)
    assert not publisher.has_listeners
    publisher.publish(FakeMessage(b"x"))
    publisher.close()


@pytest.mark.parametrize("topic", [{}, {"latch": True}, {"greet": True}])
def test_listeners_are_noticed_at_the_next_turn_and_forgotten_with_the_message_after(hub, impl, topic):
    publisher = make(hub, impl, **topic)
    for _ in range(2):
        listener = impl.connect()
        hub.attention.append(publisher)  # as rospy's listener does
        hub.service()
        assert publisher.has_listeners
        publisher.publish(FakeMessage(b"x"))
        assert publisher.has_listeners and listener.received()[-1] == b"x"
        listener.close()
        publisher.publish(FakeMessage(b"y"))
        assert not publisher.has_listeners


def test_who_was_connected_before_the_registration_is_noticed(hub, impl):
    impl.connect()
    publisher = make(hub, impl)
    hub.service()
    assert publisher.has_listeners


def test_a_full_peer_loses_the_newest_messages_and_stays_in_frame(hub, impl):
    publisher, slow, quick = make(hub, impl), impl.connect(), impl.connect()
    quick_got = []
    for number in range(3000):
        publisher.publish(FakeMessage(struct.pack("<I", number) * 500))
        hub.service()
        quick_got += quick.received()
    assert len(quick_got) == 3000
    slow_got = []
    while messages := slow.received():
        slow_got += messages
        hub.service()
    assert slow.rest == b"" and 0 < len(slow_got) < 3000
    assert slow_got == [struct.pack("<I", number) * 500 for number in range(len(slow_got))]
    assert not hub.backlog
    # It counts as stopped, so it is not tried at once.
    wait_until(lambda: publisher.publish(FakeMessage(b"alive")) or slow.received() == [b"alive"], "the slow one")


def test_a_message_larger_than_the_socket_arrives_in_parts(hub, impl):
    publisher, peer = make(hub, impl), impl.connect()
    content = bytes(range(256)) * 16384
    publisher.publish(FakeMessage(content))
    assert publisher in hub.backlog
    got = []
    for _ in range(1000):
        got += peer.received()
        if got:
            break
        hub.service()
    assert got == [content]
    assert publisher not in hub.backlog


def test_a_dead_peer_is_closed_and_the_others_go_on(hub, impl):
    publisher, dead, living = make(hub, impl), impl.connect(), impl.connect()
    dead.far.close()
    for _ in range(3):
        publisher.publish(FakeMessage(b"x"))
    assert impl.connections == [living]
    assert living.received() == [b"x"] * 3


def test_a_socket_that_rospy_closed_meanwhile_is_no_error(hub, impl):
    publisher, gone, living = make(hub, impl), impl.connect(), impl.connect()
    publisher.publish(FakeMessage(b"x"))
    gone.socket.close()
    publisher.publish(FakeMessage(b"y"))
    assert living.received() == [b"x", b"y"]


def test_late_joiners_of_a_latched_topic_get_the_last_message_once(hub, impl):
    publisher, early = make(hub, impl, latch=True), impl.connect()
    publisher.publish(FakeMessage(b"old"))
    publisher.publish(FakeMessage(b"state"))
    late = impl.connect()
    hub.attention.append(publisher)
    hub.service()
    hub.attention.append(publisher)
    hub.service()
    assert early.received() == [b"old", b"state"]
    assert late.received() == [b"state"]


def test_a_joiner_that_a_new_message_reaches_first_gets_only_that(hub, impl):
    publisher = make(hub, impl, latch=True)
    publisher.publish(FakeMessage(b"old"))
    late = impl.connect()
    publisher.publish(FakeMessage(b"new"))
    hub.attention.append(publisher)
    hub.service()
    assert late.received() == [b"new"]


def test_what_was_published_before_registration_is_latched(hub, impl):
    publisher = LoopPublisher(hub, "/topic", FakeMessage, latch=True)
    publisher.publish(FakeMessage(b"early"))
    late = impl.connect()
    publisher.attach(impl)
    hub.service()
    assert late.received() == [b"early"]


def test_joiners_of_an_ordinary_topic_get_nothing_old(hub, impl):
    publisher = make(hub, impl)
    impl.connect()
    publisher.publish(FakeMessage(b"old"))
    late = impl.connect()
    hub.attention.append(publisher)
    hub.service()
    assert late.received() == []


def present(hub, impl):
    """A publisher of the state of a world, and what it was asked for."""
    publisher, asked = make(hub, impl, FakeStamped), []

    def state():
        asked.append(len(asked))
        return FakeStamped(), FakeStamped()

    publisher.present = state
    return publisher, asked


def test_who_joins_a_paused_world_gets_its_state_once(hub, impl):
    publisher, asked = present(hub, impl)
    early = impl.connect()
    publisher.publish(FakeStamped())
    late = impl.connect()
    hub.attention.append(publisher)
    for _ in range(3):
        hub.service(is_paused=True)
    assert early.received() == [b"seq 1"] and late.received() == [b"seq 2", b"seq 3"] and asked == [0]
    assert publisher.has_listeners


def test_who_joins_before_the_pause_gets_the_state_at_the_pause_if_nothing_has_come(hub, impl):
    publisher, asked = present(hub, impl)
    peer = impl.connect()
    hub.attention.append(publisher)
    hub.service()
    assert peer.received() == [] and asked == []
    hub.service(is_paused=True)
    assert peer.received() == [b"seq 1", b"seq 2"]
    served = impl.connect()
    hub.attention.append(publisher)
    hub.service()
    publisher.publish(FakeStamped())
    hub.service(is_paused=True)
    assert served.received() == [b"seq 3"] and asked == [0]


def test_a_new_state_is_told_to_everybody_in_a_paused_world_and_to_nobody_in_another(hub, impl):
    publisher, asked = present(hub, impl)
    peer = impl.connect()
    publisher.publish(FakeStamped())
    publisher.renew()
    hub.service(is_paused=True)
    hub.service(is_paused=True)
    assert peer.received() == [b"seq 1", b"seq 2", b"seq 3"] and asked == [0]
    publisher.renew()
    hub.service()
    publisher.publish(FakeStamped())
    hub.service(is_paused=True)
    assert peer.received() == [b"seq 4"] and asked == [0]
    publisher.renew()
    publisher.close()
    assert not hub.unserved


def test_who_has_left_before_the_pause_costs_nothing(hub, impl):
    publisher, asked = present(hub, impl)
    gone = impl.connect()
    hub.attention.append(publisher)
    hub.service()
    gone.close()
    hub.attention.append(publisher)
    hub.service()
    hub.service(is_paused=True)
    assert asked == []


def test_a_dead_peer_and_a_state_that_cannot_be_made_leave_the_others(hub, impl):
    publisher, _ = present(hub, impl)
    other = make(hub, FakeImpl())
    other.present = lambda: 1 / 0
    broken, well = impl.connect(), impl.connect()
    other._impl.connect()
    hub.attention.extend([publisher, other])
    hub.service()
    broken.socket.close()
    with contextlib.suppress(ZeroDivisionError):
        hub.service(is_paused=True)
    hub.service(is_paused=True)
    assert well.received() == [b"seq 1", b"seq 2"]
    publisher.publish(FakeStamped())
    assert well.received() == [b"seq 3"] and not other._unserved


def test_headers_are_numbered_from_one(hub, impl):
    publisher, peer = make(hub, impl, FakeStamped), impl.connect()
    for _ in range(3):
        publisher.publish(FakeStamped())
    assert peer.received() == [b"seq 1", b"seq 2", b"seq 3"]


def test_close_gives_the_registration_back_once(hub, impl):
    released = []
    publisher = LoopPublisher(hub, "/topic", FakeMessage, release=lambda: released.append(1))
    publisher.attach(impl)
    impl.connect()
    publisher.close()
    publisher.close()
    publisher.publish(FakeMessage(b"x"))
    hub.service()
    assert released == [1] and not publisher.has_listeners


def test_two_publishers_of_one_topic_do_not_write_into_each_others_messages():
    impl, hub = FakeImpl(), PublisherHub()
    first, second = (LoopPublisher(hub, "/topic", FakeMessage) for _ in range(2))
    for publisher in (first, second):
        publisher.attach(impl)
    transport = impl.connect()
    hub.service()
    large = b"a" * 3_000_000  # more than the sockets take at once
    first.publish(FakeMessage(large))
    second.publish(FakeMessage(b"b" * 100))
    got = []
    while len(got) < 1:
        got += transport.received()
        hub.service()
    second.publish(FakeMessage(b"c" * 100))
    got += transport.received()
    assert got == [large, b"c" * 100]


@pytest.mark.parametrize("size", [8, 100_000])
def test_a_peer_that_has_stopped_is_asked_now_and_then_and_served_when_it_reads_again(impl, monkeypatch, size):
    now, asked, send = [0.0], [], publishing._send
    monkeypatch.setattr(publishing, "_send", lambda *arguments: asked.append(now[0]) or send(*arguments))
    transport = impl.connect()
    peer = Peer(transport, clock=lambda: now[0])
    message = struct.pack("<I", size) + bytes(size)
    while not peer.dropped:
        peer.send(message)
    # A queue that is full for a moment loses no message.
    now[0] += 0.9 * STOPPED_S
    before = len(asked)
    for _ in range(10):
        peer.send(message)
    assert len(asked) == before + 10
    now[0] += 0.2 * STOPPED_S
    peer.send(message)
    began, before = now[0], len(asked)
    for tick in range(500):
        now[0] = began + 0.002 * tick
        peer.send(message)
        peer.flush()
    assert 1 <= len(asked) - before <= 1.0 / STOPPED_RETRY_S + 1
    now[0] += STOPPED_RETRY_S
    whole = len(transport.received())
    for _ in range(3):
        peer.flush()
        whole += len(transport.received())
    peer.send(message)
    assert transport.received() == [bytes(size)]
    assert whole > 0
