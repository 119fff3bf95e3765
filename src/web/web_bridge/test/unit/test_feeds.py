# SPDX-License-Identifier: BSD-3-Clause
import json

import cbor2
import pytest
from fake_graph import FakeGraph, message_class, now
from std_msgs.msg import Int32, String

from web_bridge.codec import Codec
from web_bridge.errors import BridgeError
from web_bridge.feeds import MAX_OF_A_TOPIC, Arrival, Feeds, Wish
from web_bridge.outgoing import OutgoingBuffer

TOPIC = "/chatter"


class Client:
    def __init__(self):
        self.outgoing = OutgoingBuffer(lambda: None)
        self.told = []

    def status(self, level, text, name):
        self.told.append(text)

    def frames(self):
        found = []
        while (frames := self.outgoing.take()) is not None:
            found += frames
        return found

    def texts(self):
        return [json.loads(frame)["msg"]["data"] for frame in self.frames()]


class Clock:
    """Time that a test moves; calls that were planned run as it passes."""

    def __init__(self):
        self.now = 100.0
        self.planned = []

    def later(self, delay_s, function):
        handle = Planned(self, self.now + delay_s, function)
        self.planned.append(handle)
        return handle

    def advance(self, seconds):
        end = self.now + seconds
        while due := [one for one in self.planned if one.at <= end + 1e-9]:
            first = min(due, key=lambda one: one.at)
            self.planned.remove(first)
            self.now = first.at
            first.function()
        self.now = end


class Planned:
    def __init__(self, clock, at, function):
        self.clock, self.at, self.function = clock, at, function

    def cancel(self):
        if self in self.clock.planned:
            self.clock.planned.remove(self)


class Lab:
    def __init__(self):
        self.graph, self.clock, self.client = FakeGraph(), Clock(), Client()
        self.codec = Codec(message_class, now)
        self.feeds = Feeds(self.graph, self.codec, self.clock.later, lambda: self.clock.now)

    def subscribe(self, name="a", client=None, type_name="std_msgs/String", **wish):
        self.feeds.subscribe(client or self.client, name, TOPIC, type_name, Wish(**wish))

    def say(self, *texts, **options):
        for text in texts:
            self.graph.send(TOPIC, String(text), **options)


@pytest.fixture
def lab():
    return Lab()


@pytest.mark.parametrize("compression", ["none", "png", "cbor", "cbor-raw"])
def test_a_message_reaches_all_clients_as_the_same_object(lab, compression):
    clients = [Client() for _ in range(3)]
    for client in clients:
        lab.subscribe(client=client, compression=compression)
    lab.say("hello")
    frames = [client.frames() for client in clients]
    assert frames[0][0] is frames[1][0] is frames[2][0]
    assert len(lab.graph.subscribers[TOPIC]) == 1


def test_the_last_client_takes_the_subscription_along(lab):
    other = Client()
    lab.subscribe()
    lab.subscribe(client=other)
    assert lab.feeds.unsubscribe(lab.client, TOPIC) and lab.graph.subscribers
    lab.feeds.forget(other)
    assert not lab.graph.subscribers and not lab.feeds.unsubscribe(other, TOPIC)


def test_a_client_has_a_limited_number_of_subscriptions_to_a_topic(lab):
    for number in range(MAX_OF_A_TOPIC):
        lab.subscribe(str(number))
    with pytest.raises(BridgeError, match="this client has 1000 subscriptions to .* already; unsubscribe"):
        lab.subscribe("one more")
    # Not one more, and another client.
    lab.subscribe("7", throttle_rate=5)
    other = Client()
    lab.subscribe(client=other)
    lab.feeds.unsubscribe(lab.client, TOPIC, "8")
    lab.subscribe("one more")
    lab.say("hello")
    assert lab.client.texts() == other.texts() == ["hello"]


def test_one_of_two_subscriptions_can_end(lab):
    lab.subscribe("a")
    lab.subscribe("b")
    lab.feeds.unsubscribe(lab.client, TOPIC, "a")
    lab.say("hello")
    assert lab.client.texts() == ["hello"]


def test_messages_between_are_left_out_without_a_queue(lab):
    lab.subscribe(throttle_rate=100)
    lab.say("a", "b")
    lab.clock.advance(0.09)
    lab.say("c")
    lab.clock.advance(0.02)
    lab.say("d")
    assert lab.client.texts() == ["a", "d"]


def test_with_a_queue_the_newest_follow_one_by_one(lab):
    lab.subscribe(throttle_rate=100, queue_length=2)
    lab.say("a", "b", "c", "d")
    assert lab.client.texts() == ["a"]
    lab.clock.advance(0.1)
    assert lab.client.texts() == ["c"]
    lab.clock.advance(0.1)
    assert lab.client.texts() == ["d"]
    lab.clock.advance(0.05)
    lab.say("e")
    assert lab.client.texts() == []
    lab.clock.advance(0.05)
    assert lab.client.texts() == ["e"]


def test_an_ended_subscription_sends_nothing_later(lab):
    lab.subscribe(throttle_rate=100, queue_length=2)
    lab.say("a", "b")
    lab.feeds.unsubscribe(lab.client, TOPIC)
    lab.clock.advance(1.0)
    assert lab.client.texts() == ["a"] and not lab.clock.planned


def test_two_subscriptions_of_a_client_are_joined(lab):
    assert Wish(100, 5, 0, "cbor").joined(Wish(50, 8, 300, "png")) == Wish(50, 5, 300, "cbor")
    lab.subscribe("a", throttle_rate=1000)
    lab.subscribe("b", throttle_rate=0)
    lab.say("a", "b")
    assert lab.client.texts() == ["a", "b"]


def test_a_waiting_client_keeps_its_newest_messages(lab):
    lab.subscribe(queue_length=2)
    lab.say("a", "b", "c")
    assert lab.client.texts() == ["b", "c"]


def test_all_compressions(lab):
    found = {}
    for compression in ("none", "png", "cbor", "cbor-raw"):
        client = Client()
        lab.subscribe(client=client, compression=compression)
        found[compression] = client
    lab.say("hé")
    message = {"op": "publish", "topic": TOPIC, "msg": {"data": "hé"}}
    frames = {compression: client.frames()[0] for compression, client in found.items()}
    assert json.loads(frames["none"]) == message and json.loads(frames["png"])["op"] == "png"
    assert cbor2.loads(frames["cbor"]) == message
    assert cbor2.loads(frames["cbor-raw"])["msg"] == {"bytes": b"\3\0\0\0h\xc3\xa9", "secs": 5, "nsecs": 6}


def test_fragments_are_whole_together(lab):
    lab.subscribe(fragment_size=10)
    lab.say("hello")
    pieces = [json.loads(frame) for frame in lab.client.frames()]
    assert all(len(piece["data"]) <= 10 for piece in pieces)
    assert json.loads("".join(piece["data"] for piece in pieces))["msg"] == {"data": "hello"}


def test_a_message_is_not_sent_in_millions_of_fragments(lab):
    other = Client()
    lab.subscribe(fragment_size=1)
    lab.subscribe(client=other, fragment_size=10)
    lab.say("x" * 10_000, "y" * 10_001, "z")
    assert lab.client.told == ["a message of /chatter is not sent: in fragments of 1 characters it would be more than "
                               "10000; a larger fragment_size is needed"]
    whole = "".join(json.loads(frame)["data"] for frame in lab.client.frames())
    assert json.loads(whole)["msg"] == {"data": "z"}
    assert len(other.frames()) > 2000 and not other.told


def test_each_later_subscription_gets_what_was_latched_unless_its_publisher_has_gone(lab):
    lab.subscribe()
    lab.say("old", publisher="/gone", is_latched=True)
    lab.say("new", publisher="/there", is_latched=True)
    lab.say("said", publisher="/speaker")
    lab.graph.alive.discard("/gone")
    later = Client()
    lab.subscribe(client=later)
    assert later.texts() == ["new"]
    # As a second object of a page for the same topic, even where it wants a message an hour.
    lab.subscribe("again", client=later, throttle_rate=3600_000)
    assert later.texts() == ["new"]
    lab.subscribe("again", client=later, compression="cbor")
    assert cbor2.loads(later.frames()[0])["msg"] == {"data": "new"}


def test_a_message_that_cannot_be_read_is_told_once_and_cbor_raw_needs_no_type(lab):
    raw = Client()
    lab.subscribe()
    lab.subscribe(client=raw, compression="cbor-raw", type_name=None)
    arrived = lab.graph.subscribers[TOPIC][0]
    for _ in range(3):
        arrived(Arrival(b"abc", "nobodys_msgs/Thing", "00", (1, 2), "/a"))
    assert len(lab.client.told) == 1 and "nobodys_msgs/Thing" in lab.client.told[0]
    assert len(raw.frames()) == 3
    arrived(Arrival(b"\0\0\0\0", "std_msgs/String", "00", (1, 2), "/a"))
    assert "another definition of std_msgs/String" in lab.client.told[1]
    arrived(Arrival(b"\xff", "std_msgs/String", String._md5sum, (1, 2), "/a"))
    assert "1 bytes are no std_msgs/String" in lab.client.told[2]


def test_a_wrong_type_is_refused(lab):
    lab.graph.types[TOPIC] = Int32._type
    with pytest.raises(BridgeError, match="/chatter has the type std_msgs/Int32, not std_msgs/String"):
        lab.subscribe()
    assert not lab.graph.subscribers
