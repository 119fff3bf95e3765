# SPDX-License-Identifier: BSD-3-Clause
"""The fake behaves as the simulator's own code: the same cases run against both."""
import contextlib
import inspect
import itertools
import threading
from types import SimpleNamespace

import genpy
import pytest
import rospy
from actionlib_msgs.msg import GoalID
from control_msgs.msg import (
    FollowJointTrajectoryAction,
    FollowJointTrajectoryActionGoal,
    FollowJointTrajectoryResult,
)
from dynamic_reconfigure.encoding import decode_config, encode_config
from dynamic_reconfigure.srv import ReconfigureRequest
from geometry_msgs.msg import Point, PointStamped
from std_msgs.msg import Header, String
from std_srvs.srv import SetBool, SetBoolRequest, SetBoolResponse

from loop_ros import protocol, ros_objects
from loop_ros.action_server import ActionServer
from loop_ros.faults import Faults
from loop_ros.log import LoopLog
from loop_ros.names import IllegalName, checked_name
from loop_ros.node_handle import NodeHandle
from loop_ros.publisher import LoopPublisher, PublisherHub
from loop_ros.reconfigure import Setting, SettingsServer
from loop_ros.request_queue import RequestQueue
from loop_ros.subscriber import SubscriberHub
from loop_ros.subscription import MessageQueue
from loop_ros.testing import FakeFaults, FakeLog, FakePublisher, FakeRos

TOPIC, SERVICE = "/topic", "/service"


class Fake:
    """The operations of the tests, on the fake."""

    def __init__(self, _monkeypatch):
        self.ros = FakeRos(heard=lambda topic: False)
        self.context = NodeHandle(self.ros)
        self.log = FakeLog()

    def listen(self, topic):
        """Add a subscriber; returns a function that returns its messages."""
        publisher = self.ros.publishers[topic]
        publisher.has_listeners = True
        return lambda: list(publisher.messages)

    def send(self, topic, message):
        self.ros.subscriptions[topic].put(message)

    def call(self, service, request):
        return self.ros.services[service](request)

    def has_service(self, service):
        return service in self.ros.services

    def turn(self):
        """The loop looks for messages; here it always does."""

    def lines(self):
        return self.log.lines

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
    """The same on the simulator's own code, with a rospy without a master."""

    def __init__(self, monkeypatch):
        self._subscribed, self._served, self._published, self._lines = {}, {}, {}, []
        monkeypatch.setattr(ros_objects, "rospy", SimpleNamespace(
            Publisher=self._publisher, Subscriber=self._subscriber, Service=self._service,
            ServiceException=rospy.ServiceException, is_shutdown=lambda: False,
            resolve_name=rospy.resolve_name))
        monkeypatch.setattr("loop_ros.publisher.Peer.of", classmethod(lambda cls, peer: SimpleNamespace(
            transport=peer, send=peer.take, has_rest=False)))
        self.log = LoopLog(dict.fromkeys(("info", "warn", "error"), self._lines.append))
        self._requests, self._hub = RequestQueue(), PublisherHub()
        self._subscribers = SubscriberHub(itertools.count().__next__)
        self.ros = ros_objects.RosObjects(self._hub, self._subscribers, self._requests, self.log, Faults(self.log))
        self.context = NodeHandle(self.ros)

    def _publisher(self, topic, msg_class, latch=False, queue_size=None):
        impl = SimpleNamespace(connections=[], remove_connection=lambda connection: None,
                               set_queue_size=lambda size: None, add_subscriber_listener=lambda listener: None)
        self._published[topic] = impl, msg_class
        return SimpleNamespace(impl=impl, unregister=lambda: None)

    def _subscriber(self, topic, msg_class, callback, tcp_nodelay=False):
        callbacks = self._subscribed.setdefault(topic, [])
        callbacks.append(callback)
        return SimpleNamespace(impl=SimpleNamespace(add_connection=None), get_num_connections=lambda: 0,
                               unregister=lambda: callbacks.remove(callback))

    def _service(self, name, srv_class, answer):
        self._served[name] = answer
        return SimpleNamespace(shutdown=lambda reason: self._served.pop(name, None))

    def listen(self, topic):
        self.ros.flush()
        impl, msg_class = self._published[topic]
        peer = _Peer(msg_class)
        impl.connections = [peer]
        self._hub.service()
        return peer.messages

    def send(self, topic, message):
        self.ros.flush()
        for callback in self._subscribed[topic]:
            callback(message)

    def call(self, service, request):
        """From a thread, as rospy does, with the loop at work."""
        self.ros.flush()
        outcome = []

        def ask():
            try:
                outcome.append(self._served[service](request))
            except Exception as error:  # noqa: BLE001  (raised below, in the caller's thread)
                outcome.append(error)

        client = threading.Thread(target=ask, daemon=True)
        client.start()
        while client.is_alive():
            self._requests.run_pending()
            client.join(0.001)
        if isinstance(outcome[0], Exception):
            raise outcome[0]
        return outcome[0]

    def has_service(self, service):
        self.ros.flush()
        return service in self._served

    def turn(self):
        self._subscribers.service()

    def lines(self):
        self.log.close()
        return list(self._lines)

    def close(self):
        self.log.close()


def parameters_of(owner, method):
    """[(name, default)] of a method's parameters, without self."""
    parameters = list(inspect.signature(getattr(owner, method)).parameters.values())
    return [(each.name, "a function" if callable(each.default) and each.default is not each.empty else each.default)
            for each in parameters if each.name != "self"]


def methods_of(owner):
    return [name for name, value in vars(owner).items() if inspect.isfunction(value) and not name.startswith("_")]


@pytest.mark.parametrize(("declared", "made"), [
    (protocol.LoopRos, ros_objects.RosObjects), (protocol.LoopRos, FakeRos), (protocol.Log, LoopLog),
    (protocol.Log, FakeLog), (protocol.Topics, NodeHandle), (protocol.Publisher, LoopPublisher),
    (protocol.Publisher, FakePublisher), (protocol.Subscription, MessageQueue),
    (protocol.FaultCounter, Faults), (protocol.FaultCounter, FakeFaults),
])
def test_both_have_the_declared_methods(declared, made):
    assert methods_of(declared)
    for method in methods_of(declared):
        found, wanted = parameters_of(made, method), parameters_of(declared, method)
        if declared is protocol.FaultCounter:  # each has its own wording
            found, wanted = [name for name, _ in found], [name for name, _ in wanted]
        assert found == wanted, method


@pytest.fixture(params=[Fake, Real], ids=["fake", "real"])
def side(request, monkeypatch):
    made = request.param(monkeypatch)
    yield made
    made.close()


def test_the_loop_counts_how_often_it_has_looked_for_messages(side):
    before = side.context.reads()
    side.turn()
    assert side.context.reads() > before


def test_without_a_depth_only_the_newest_counts(side):
    box = side.context.subscription(TOPIC, String)
    assert box.take() is None
    for text in "abc":
        side.send(TOPIC, String(text))
    assert (box.take().data, box.take()) == ("c", None)
    got = []
    for text in "de":
        side.send(TOPIC, String(text))
    box.handle(lambda message: got.append(message.data))
    box.handle(lambda message: got.append(message.data))
    assert got == ["e"]


def test_a_subscription_loses_the_oldest_beyond_its_depth(side):
    queue = side.context.subscription(TOPIC, String, 3)
    for text in "abcde":
        side.send(TOPIC, String(text))
    assert [message.data for message in queue.drain()] == ["c", "d", "e"]
    assert queue.drain() == []


@pytest.mark.parametrize("error", [ValueError, RecursionError, SystemExit])
@pytest.mark.parametrize("depth", [1, 5])
def test_a_message_that_somebody_fails_on_is_dropped_alone(side, error, depth):
    queue, got = side.context.subscription(TOPIC, String, 5), []

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
    one, two = side.context.subscription(TOPIC, String, 3), side.context.subscription(TOPIC, String)
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


def test_messages_are_numbered_and_numbers_rounded_as_on_the_wire(side):
    publisher = side.context.publisher(TOPIC, PointStamped)
    got = side.listen(TOPIC)
    message = type("OwnPoint", (PointStamped,), {})(Header(), Point(1, 2, 3))
    for _ in range(2):
        publisher.publish(message)
    assert [each.header.seq for each in got()] == [1, 2]
    assert isinstance(got()[0].point.x, float) and type(got()[0]) is PointStamped


@pytest.mark.parametrize(("latch", "texts"), [(True, ["newest", "more"]), (False, ["more"])])
def test_a_late_listener_gets_the_last_message_of_a_latched_topic(side, latch, texts):
    publisher = side.context.publisher(TOPIC, String, latch)
    for text in ("old", "newest"):
        publisher.publish(String(text))
    assert not publisher.has_listeners
    got = side.listen(TOPIC)
    assert publisher.has_listeners
    publisher.publish(String("more"))
    assert [message.data for message in got()] == texts


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


@pytest.mark.parametrize("kind", ["service", "service_in_thread"])
def test_a_handler_that_raises_is_an_error_for_the_client_and_counted(side, kind):
    getattr(side.context, kind)(SERVICE, SetBool, lambda request: 1 / 0)
    with pytest.raises(rospy.ServiceException, match="/service failed: ZeroDivisionError"):
        side.call(SERVICE, SetBoolRequest(True))
    assert {place: fault.count for place, fault in side.ros.faults.places.items()} == {SERVICE: 1}


def test_faults_of_messages_are_counted_by_topic(side):
    side.context.subscription(TOPIC, String, 3)
    box = side.context.subscription("/other", String)
    side.send("/other", String("x"))
    box.handle(lambda message: 1 / 0)
    side.context.survived("drawing", ValueError("y"))
    assert {place: fault.count for place, fault in side.ros.faults.places.items()} == {"/other": 1, "drawing": 1}


def test_what_came_in_is_told_once_and_counts_on_after_the_end(side):
    first, second = side.context.subscription(TOPIC, String, 3), side.context.subscription("/other", String, 3)
    side.send("/other", String("x"))
    assert side.context.pending() == [second] and not side.context.pending()
    assert side.ros.deliveries() == {TOPIC: 0, "/other": 1}
    again = side.context.subscription("/other", String, 3)
    second.close()
    side.send("/other", String("y"))
    assert [message.data for message in again.drain()] == ["y"] and second.drain() == first.drain() == []
    assert side.ros.deliveries() == {TOPIC: 0, "/other": 2}


@pytest.mark.parametrize("name", ["/a\x01b", "/a\0", "/a b", "/a-b", "/w\u00fcrfel", "/", "/a\n", "/a:b"])
def test_a_name_that_is_none_in_ros_is_refused_where_it_is_opened(side, name):
    context = NodeHandle(side.ros, "/ns")
    for make in (lambda: context.publisher(name, String), lambda: context.subscription(name, String),
                 lambda: context.service(name, SetBool, None), lambda: context.service_in_thread(name, SetBool, None)):
        with pytest.raises(IllegalName) as found:
            make()
        assert ascii(name)[1:-1] in str(found.value) and str(found.value).isprintable()
    assert side.context.served() == [] and not side.has_service(name)


def test_slashes_that_are_too_many_are_none(side):
    assert checked_name("//a///1b/") == "/a/1b"
    side.context.publisher("//a//b", String)
    side.ros.flush()


def test_what_is_withdrawn_is_its_withdrawers_alone(side):
    side.context.service(SERVICE, SetBool, lambda request: SetBoolResponse(request.data, "served"))
    queue = side.context.subscription(TOPIC, String, 3)
    side.send(TOPIC, String("unread"))
    assert side.context.served() == [SERVICE] and side.context.subscribed() == [TOPIC]
    handler = side.context.withdraw(SERVICE)
    assert handler(SetBoolRequest(True)) == SetBoolResponse(True, "served")
    assert not side.has_service(SERVICE) and side.context.served() == []
    assert side.context.withdraw(TOPIC) is None and side.context.withdraw("/nothing") is None
    assert queue.drain() == [] and side.ros.deliveries() == {} and side.context.subscribed() == []


def test_an_action_is_served(side):
    begun = []
    server = ActionServer(side.context, "/act", FollowJointTrajectoryAction, begun.append, None)
    got = side.listen("/act/result")
    side.send("/act/goal", FollowJointTrajectoryActionGoal(goal_id=GoalID(id="one")))
    server.spin(1.0)
    begun[0].accept()
    begun[0].succeed(FollowJointTrajectoryResult(error_code=3), "done")
    result, = got()
    assert (result.result.error_code, result.status.text, result.status.goal_id.id) == (3, "done", "one")


def test_settings_are_served(side):
    applied = []
    SettingsServer(side.context, "/pid", [Setting("p", 1.0, 0.0, 9.0)], applied.append)
    got = side.listen("/pid/parameter_updates")
    side.call("/pid/set_parameters", ReconfigureRequest(encode_config({"p": 20.0})))
    assert applied == [{"p": 9.0}]
    assert [decode_config(config)["p"] for config in got()] == [1.0, 9.0]


def test_after_its_end_a_context_has_nothing_open(side):
    publisher, queue = side.context.publisher(TOPIC, String), side.context.subscription("/in", String, 3)
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
    # Each from a line of its own: the simulator drops throttled lines that repeat from one place.
    side.log.info_throttle(5.0, "d")
    side.log.warn_throttle(5.0, "e")
    side.log.error_throttle(5.0, "f")
    assert side.lines() == list("abcdef")
