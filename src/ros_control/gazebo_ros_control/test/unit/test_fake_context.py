# SPDX-License-Identifier: BSD-3-Clause
"""The fake context of the controllers' tests answers as the simulator's own does: the same cases for both."""
import contextlib
import threading
from types import SimpleNamespace

import genpy
import pytest
import rospy
from geometry_msgs.msg import Point
from std_msgs.msg import String
from std_srvs.srv import SetBool, SetBoolRequest, SetBoolResponse

from controller_manager.testing import FakeLog, FakeRos
from gazebo_ros import ros_objects
from gazebo_ros.faults import Faults
from gazebo_ros.loop_log import LoopLog
from gazebo_ros.loop_publisher import PublisherHub
from gazebo_ros.loop_subscriber import InletHub
from gazebo_ros.mailbox import RequestBoard
from gazebo_ros.model_plugin import PluginContext, PluginSource

TOPIC, SERVICE = "/topic", "/service"


class Fake:
    """What the tests do with the fake."""

    def __init__(self, _monkeypatch):
        self.context = FakeRos()
        self.log = FakeLog()

    def listen(self, topic):
        """Somebody listens; returns a function: the messages that he has got."""
        return lambda: list(self.context.publishers[topic].messages)

    def send(self, topic, message):
        self.context.inboxes[topic].put(message)

    def call(self, service, request):
        return self.context.services[service](request)

    def has_service(self, service):
        return service in self.context.services

    def lines(self):
        return [text for _, text in self.log.lines]

    def close(self):
        pass


class _Peer:
    """rospy's connection to one listener, as far as a LoopPublisher uses it."""

    def __init__(self, msg_class):
        self._msg_class, self._data = msg_class, bytearray()

    def take(self, data):
        self._data += data
        return len(data)

    def messages(self):
        found, rest = [], bytes(self._data)
        while rest:
            length = int.from_bytes(rest[:4], "little")
            found.append(self._msg_class().deserialize(rest[4:4 + length]))
            rest = rest[4 + length:]
        return found


class Real:
    """The same with the simulator's own, on a rospy without a master."""

    def __init__(self, monkeypatch):
        self._subscribed, self._served, self._published, self._lines = {}, {}, {}, []
        monkeypatch.setattr(ros_objects, "rospy", SimpleNamespace(
            Publisher=self._publisher, Subscriber=self._subscriber, Service=self._service,
            ServiceException=rospy.ServiceException, is_shutdown=lambda: False))
        monkeypatch.setattr("gazebo_ros.loop_publisher.Peer.of", classmethod(lambda cls, peer: SimpleNamespace(
            transport=peer, send=peer.take, has_rest=False)))
        self.log = LoopLog(dict.fromkeys(("info", "warn", "error"), self._lines.append))
        self._board, self._hub = RequestBoard(), PublisherHub()
        objects = ros_objects.RosObjects(self._hub, InletHub(), self._board, self.log, Faults(self.log))
        self.context = PluginContext(None, None, PluginSource(), self.log, objects, {})
        self._objects = objects

    def _publisher(self, topic, msg_class, latch=False, queue_size=None):
        impl = SimpleNamespace(connections=[], set_queue_size=lambda size: None,
                               add_subscriber_listener=lambda listener: None)
        self._published[topic] = impl, msg_class
        return SimpleNamespace(impl=impl, unregister=lambda: None)

    def _subscriber(self, topic, msg_class, callback, tcp_nodelay=False):
        callbacks = self._subscribed.setdefault(topic, [])
        callbacks.append(callback)
        return SimpleNamespace(impl=SimpleNamespace(add_connection=None), unregister=lambda: callbacks.remove(callback))

    def _service(self, name, srv_class, answer):
        self._served[name] = answer
        return SimpleNamespace(shutdown=lambda reason: self._served.pop(name, None))

    def listen(self, topic):
        self._objects.flush()
        impl, msg_class = self._published[topic]
        peer = _Peer(msg_class)
        impl.connections = [peer]
        self._hub.service()
        return peer.messages

    def send(self, topic, message):
        self._objects.flush()
        for callback in self._subscribed[topic]:
            callback(message)

    def call(self, service, request):
        """From a thread, as rospy does, with the loop at work."""
        self._objects.flush()
        outcome = []

        def ask():
            try:
                outcome.append(self._served[service](request))
            except Exception as error:  # noqa: BLE001  (raised below, in the caller's thread)
                outcome.append(error)

        client = threading.Thread(target=ask, daemon=True)
        client.start()
        while client.is_alive():
            self._board.run_pending()
            client.join(0.001)
        if isinstance(outcome[0], Exception):
            raise outcome[0]
        return outcome[0]

    def has_service(self, service):
        self._objects.flush()
        return service in self._served

    def lines(self):
        self.log.close()
        return list(self._lines)

    def close(self):
        self.log.close()


@pytest.fixture(params=[Fake, Real], ids=["fake", "real"])
def side(request, monkeypatch):
    made = request.param(monkeypatch)
    yield made
    made.close()


def test_of_a_mailbox_only_the_newest_counts(side):
    box = side.context.mailbox(TOPIC, String)
    assert box.take() is None
    for text in "abc":
        side.send(TOPIC, String(text))
    assert (box.take().data, box.take()) == ("c", None)
    got = []
    for text in "de":
        side.send(TOPIC, String(text))
    box.handle(lambda message: got.append(message.data))
    box.handle(lambda message: got.append(message.data))
    assert got == ["e"] and not hasattr(box, "drain")


def test_a_queue_loses_the_oldest_beyond_its_depth(side):
    queue = side.context.queue(TOPIC, String, 3)
    for text in "abcde":
        side.send(TOPIC, String(text))
    assert [message.data for message in queue.drain()] == ["c", "d", "e"]
    assert queue.drain() == [] and not hasattr(queue, "take")


@pytest.mark.parametrize("error", [ValueError, RecursionError, SystemExit])
@pytest.mark.parametrize("depth", [1, 5])
def test_a_message_that_somebody_fails_on_is_dropped_alone(side, error, depth):
    queue, got = side.context.queue(TOPIC, String, 5), []

    def take(message):
        if message.data == "bad":
            raise error("broken on purpose")
        got.append(message.data)

    for text in ("first", "bad", "last"):
        side.send(TOPIC, String(text))
    queue.handle(take)
    queue.guarded(take, String("bad"))
    assert got == ["first", "last"] and queue.drain() == []


def test_a_message_comes_to_all_who_subscribe(side):
    one, two = side.context.queue(TOPIC, String, 3), side.context.mailbox(TOPIC, String)
    side.send(TOPIC, String("x"))
    assert [message.data for message in one.drain()] == ["x"] and two.take().data == "x"


def test_a_listener_gets_messages_as_they_were_when_they_were_sent(side):
    publisher = side.context.publisher(TOPIC, String)
    got = side.listen(TOPIC)
    message = String("one")
    publisher.publish(message)
    assert publisher.has_listeners
    message.data = "two"
    publisher.publish(message)
    assert [message.data for message in got()] == ["one", "two"]


def test_a_message_that_cannot_be_sent_raises_where_it_is_published(side):
    publisher = side.context.publisher(TOPIC, Point)
    got = side.listen(TOPIC)
    with pytest.raises(genpy.SerializationError):
        publisher.publish(Point("x", 0.0, 0.0))
    assert got() == []


def test_a_service_answers_until_it_is_closed(side):
    service = side.context.service(SERVICE, SetBool, lambda request: SetBoolResponse(request.data, "served"))
    assert side.has_service(SERVICE)
    assert side.call(SERVICE, SetBoolRequest(True)) == SetBoolResponse(True, "served")
    service.close()
    service.close()
    assert not side.has_service(SERVICE)


def test_a_handler_that_raises_is_an_error_for_the_client(side):
    side.context.service(SERVICE, SetBool, lambda request: 1 / 0)
    with pytest.raises((rospy.ServiceException, ZeroDivisionError)):
        side.call(SERVICE, SetBoolRequest(True))


def test_after_its_end_a_context_has_nothing_open(side):
    publisher, queue = side.context.publisher(TOPIC, String), side.context.queue("/in", String, 3)
    side.context.service(SERVICE, SetBool, SetBoolResponse)
    got = side.listen(TOPIC)
    side.send("/in", String("unread"))
    side.context.close()
    assert queue.drain() == [] and not publisher.has_listeners and not side.has_service(SERVICE)
    with contextlib.suppress(AttributeError):
        publisher.publish(String("late"))
    assert got() == []


def test_the_log_has_every_level_and_its_throttled_variant(side):
    side.log.info("a")
    side.log.warn("b")
    side.log.error("c")
    # From places of their own: what comes again from one within the time is left out in the simulator.
    side.log.info_throttle(5.0, "d")
    side.log.warn_throttle(5.0, "e")
    side.log.error_throttle(5.0, "f")
    assert side.lines() == list("abcdef")
