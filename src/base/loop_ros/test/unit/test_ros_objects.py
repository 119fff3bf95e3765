# SPDX-License-Identifier: BSD-3-Clause
"""rospy's subscriptions, read by the loop, and what rospy's thread of a connection does meanwhile."""
import contextlib
import gc
import socket
import struct
import threading
from io import BytesIO
from types import SimpleNamespace

import pytest
import rospy
from rospy.impl.tcpros_base import TCPROSTransport
from rospy.impl.tcpros_pubsub import TCPROSPub, TCPROSSub, robust_connect_subscriber
from rospy.topics import _PublisherImpl
from std_msgs.msg import String

from lab_testing.waiting import wait_until
from loop_ros.faults import Faults
from loop_ros.node_handle import NodeHandle
from loop_ros.publisher import PublisherHub
from loop_ros.request_queue import RequestQueue
from loop_ros.ros_objects import RosObjects, _read_in_loop, remove_only_what_is_there
from loop_ros.subscriber import SubscriberHub


class Connection:
    """As rospy's transport of one publisher, after its handshake."""

    callerid_pub, header, is_latched, latch = "/somebody", {"callerid": "/somebody"}, True, None
    stat_bytes = stat_num_msg = 0

    def __init__(self):
        self.socket, self.far = socket.socketpair()
        self.read_buff = BytesIO()
        self.closed = threading.Event()

    def close(self):
        self.socket.close()
        self.closed.set()

    def send(self, text):
        self.far.sendall(framed(text))

    def send_bytes(self, data):
        self.far.sendall(struct.pack("<I", len(data)) + data)


def framed(text):
    buffer = BytesIO()
    String(text).serialize(buffer)
    return struct.pack("<I", len(buffer.getvalue())) + buffer.getvalue()


@pytest.fixture
def scene(request):
    got, errors, hub = [], [], SubscriberHub()
    impl = SimpleNamespace(data_class=String, resolved_name="/chatter", closed=False, connections=[],
                           receive_callback=lambda messages, _: got.extend(messages))
    impl.add_connection = lambda connection: impl.connections.append(connection) or True
    log = SimpleNamespace(error=errors.append)
    _read_in_loop(impl, hub, log, Faults(log))
    connection = Connection()
    connection.read_buff.write(getattr(request, "param", b""))
    assert impl.add_connection(connection)
    assert impl.connections == [connection]
    thread = threading.Thread(target=connection.receive_loop, args=(None,), daemon=True)
    thread.start()

    def serve_until(condition, what):
        wait_until(lambda: (hub.service(), condition())[1], what, 60.0)

    yield SimpleNamespace(connection=connection, got=got, errors=errors, impl=impl, hub=hub, serve_until=serve_until,
                          thread=thread)
    hub.close()
    connection.far.close()
    thread.join(60.0)
    assert not thread.is_alive()


def test_messages_reach_the_callbacks_with_their_header(scene):
    scene.connection.send("hello")
    scene.serve_until(lambda: scene.got, "the message")
    assert scene.got[0].data == "hello"
    assert scene.got[0]._connection_header["callerid"] == "/somebody"
    assert scene.connection.latch is scene.got[0]
    assert (scene.connection.stat_num_msg, scene.connection.stat_bytes) == (1, 9)


WITH_HEADER = framed("latched") + framed("and torn")


@pytest.mark.parametrize("scene", [WITH_HEADER[:cut] for cut in (2, 10, 15, 20, 27)], indirect=True,
                         ids=len)
def test_what_rospy_read_together_with_the_header_is_not_lost(scene):
    scene.connection.far.sendall(WITH_HEADER[len(scene.connection.read_buff.getvalue()):])
    scene.serve_until(lambda: len(scene.got) == 2, "both messages")
    assert [message.data for message in scene.got] == ["latched", "and torn"]


@pytest.mark.parametrize("scene", [framed("latched")], indirect=True)
def test_a_latched_message_that_came_with_the_header_needs_no_other_to_follow(scene):
    scene.serve_until(lambda: scene.got, "the message")
    assert [message.data for message in scene.got] == ["latched"]


def test_a_message_that_cannot_be_read_is_told_and_the_next_one_counts(scene):
    scene.connection.send_bytes(b"\xff\xff")
    scene.connection.send("and on")
    scene.serve_until(lambda: scene.got, "the message after it")
    assert [message.data for message in scene.got] == ["and on"]
    error, = scene.errors
    assert "/chatter: " in error and "a message from /somebody cannot be read" in error


def test_the_connection_is_closed_when_the_publisher_goes(scene):
    scene.connection.far.close()
    scene.serve_until(scene.connection.closed.is_set, "the end")
    assert not scene.errors


def test_what_is_no_message_at_all_closes_the_connection_and_is_told(scene):
    scene.connection.far.sendall(b"\xff\xff\xff\xff")
    scene.serve_until(scene.connection.closed.is_set, "the end")
    error, = scene.errors
    assert "/chatter: the connection to /somebody is closed" in error


def test_a_connection_that_rospy_gave_up_halfway_does_not_keep_the_publisher_waiting(monkeypatch):
    """Two updates from the master make rospy connect twice. It drops the first connection during its set-up, with a
    socket that closes only when the transport ends. A publisher handshakes with one subscriber at a time and would
    wait."""
    listening = socket.create_server(("localhost", 0))
    listening.settimeout(60.0)
    transport = TCPROSTransport(TCPROSSub("/chatter", String), "/chatter")
    impl = SimpleNamespace(add_connection=lambda _: True)
    _read_in_loop(impl, SubscriberHub(), None, None)
    impl.add_connection(transport)
    # connect() reads this just before it has a socket.
    monkeypatch.setattr("rospy.impl.tcpros_base._is_use_tcp_keepalive", lambda close=transport.close: close())
    gc.disable()
    try:
        robust_connect_subscriber(transport, *listening.getsockname(), "http://localhost:1/", print, "/chatter")
        monkeypatch.undo()
        del transport
        with contextlib.closing(listening.accept()[0]) as far:
            far.settimeout(60.0)
            assert far.recv(1) == b""
    finally:
        gc.enable()
        listening.close()


def test_a_connection_that_is_gone_before_it_was_read_is_closed():
    hub, connection = SubscriberHub(), Connection()
    connection.socket.close()
    impl = SimpleNamespace(add_connection=lambda _: True)
    _read_in_loop(impl, hub, None, None)
    impl.add_connection(connection)
    connection.receive_loop(None)
    assert connection.closed.is_set()
    connection.far.close()


class Registrations:
    """As rospy: making the object registers the topic, until unregister is called."""

    def __init__(self, monkeypatch):
        self.open, self.made, self.on_make = [], [], lambda: None
        monkeypatch.setattr(rospy, "Publisher", self._make)
        monkeypatch.setattr(rospy, "Subscriber", self._make)
        monkeypatch.setattr(rospy, "Service", self._make)

    def _make(self, topic, *arguments, **options):
        self.open.append(topic)
        self.made.append(topic)
        impl = SimpleNamespace(set_queue_size=lambda size: None, add_subscriber_listener=lambda listener: None,
                               add_connection=lambda connection: True, remove_connection=lambda connection: None,
                               connections=[])
        self.on_make()
        return SimpleNamespace(impl=impl, get_num_connections=int, unregister=lambda: self.open.remove(topic),
                               shutdown=lambda reason: self.open.remove(topic))


@pytest.fixture
def registrations(monkeypatch):
    return Registrations(monkeypatch)


@pytest.fixture
def objects():
    errors = []
    log = SimpleNamespace(error=errors.append)
    yield RosObjects(PublisherHub(), SubscriberHub(), RequestQueue(), log, Faults(log))
    assert not errors


def test_a_publisher_is_registered_until_it_is_closed(objects, registrations):
    publisher = objects.publisher("/states", String)
    assert objects.flush() and registrations.open == ["/states"]
    publisher.close()
    assert objects.flush() and registrations.open == []


def test_a_remapping_of_an_actions_name_moves_its_topics(objects, registrations, monkeypatch):
    monkeypatch.setattr(rospy.names, "_resolved_mappings", {
        "/arm_controller/follow_joint_trajectory": "/joint_trajectory_action", "/arm_controller": "/arm"})
    for name in ("/arm_controller/follow_joint_trajectory/status", "/arm_controller/state", "/clock"):
        objects.publisher(name, String)
    objects.subscription("/arm_controller/follow_joint_trajectory/goal", String)
    assert objects.flush()
    assert registrations.open == ["/joint_trajectory_action/status", "/arm/state", "/clock",
                                  "/joint_trajectory_action/goal"]
    assert "/joint_trajectory_action/goal" in objects.subscribed()
    objects.withdraw("/arm_controller/follow_joint_trajectory/goal")
    assert objects.subscribed() == []


def test_a_publisher_that_is_closed_before_its_turn_came_is_not_registered(objects, registrations):
    turn = threading.Event()
    objects.later(lambda: turn.wait(60.0))
    objects.publisher("/states", String).close()
    turn.set()
    assert objects.flush() and registrations.made == []


def test_a_publisher_that_is_closed_while_it_is_registered_does_not_stay(objects, registrations):
    turn, publishers = threading.Event(), []
    objects.later(lambda: turn.wait(60.0))
    registrations.on_make = lambda: publishers[0].close()
    publishers.append(objects.publisher("/states", String))
    turn.set()
    wait_until(lambda: publishers[0].is_closed, "its turn", 60.0)
    assert objects.flush() and registrations.open == []


def test_deliveries_never_become_less(objects, registrations):
    """The count of a topic goes on when one model is replaced by another."""
    first, second = (objects.subscription("/commands", String, depth=10) for _ in range(2))
    for box in (first, first, second):
        box.put(String("go"))
    assert objects.deliveries() == {"/commands": 3}
    first.close()
    assert objects.deliveries() == {"/commands": 3}
    second.close()
    assert objects.deliveries() == {}, "nobody listens to it"
    objects.subscription("/commands", String).put(String("go"))
    assert objects.deliveries() == {"/commands": 4}
    assert objects.flush() and registrations.open == ["/commands"]


@pytest.fixture
def scene_of_faults():
    errors = []
    log = SimpleNamespace(error=errors.append)
    requests = RequestQueue()
    yield SimpleNamespace(ros=RosObjects(PublisherHub(), SubscriberHub(), requests, log, Faults(log)),
                          requests=requests, errors=errors)
    requests.close()


@pytest.fixture
def services(monkeypatch):
    """{name: what rospy would call with a request}"""
    found = {}
    monkeypatch.setattr(rospy, "Service", lambda name, srv_class, handler: found.update({name: handler}) or
                        SimpleNamespace(shutdown=lambda reason: found.pop(name)))
    return found


@pytest.mark.parametrize("kind", ["service", "service_in_thread"])
@pytest.mark.parametrize("error", [KeyError("x"), RecursionError("too deep"), SystemExit(2)])
def test_a_handler_that_fails_is_an_error_to_the_caller_and_counted(scene_of_faults, services, kind, error):
    def fail(request):
        raise error

    ros = scene_of_faults.ros
    getattr(ros, kind)("/break", None, fail)
    assert ros.flush()
    answers = []

    def ask():
        try:
            services["/break"](None)
        except Exception as answer:  # noqa: BLE001
            answers.append(answer)

    client = threading.Thread(target=ask)
    client.start()
    wait_until(lambda: (scene_of_faults.requests.run_pending(), answers)[1], "the answer", 60.0)
    client.join()
    assert isinstance(answers[0], rospy.ServiceException) and "/break failed" in str(answers[0])
    assert ros.faults.places["/break"].count == 1 and "/break" in scene_of_faults.errors[0]


def test_a_message_that_a_handler_cannot_digest_is_counted_under_its_topic(scene_of_faults, registrations):
    def fail(message):
        raise ValueError(message.data)

    ros = scene_of_faults.ros
    for box in (ros.subscription("/one", String), ros.subscription("/many", String, depth=3)):
        for text in ("a", "b"):
            box.put(String(text))
        box.handle(fail)
    assert {place: fault.count for place, fault in ros.faults.places.items()} == {"/one": 1, "/many": 2}
    assert ros.flush()


def test_an_owner_that_restarts_keeps_its_topics_and_services(scene_of_faults, registrations, services):
    ros = scene_of_faults.ros
    handle = NodeHandle(ros, "/robot")

    def open_all(answer):
        return (handle.publisher("out", String), handle.publisher("other", String, latch=True),
                handle.subscription("in", String), handle.subscription("many", String, depth=3),
                handle.subscription("many", String, depth=3), handle.service("ask", None, lambda request: answer))

    first, gone = open_all("old"), handle.publisher("gone", String)
    handle.begin_restart()
    second, _ = open_all("new"), handle.publisher("more", String)
    handle.end_restart()
    assert all(one is other for one, other in zip(first, second, strict=True)) and gone.is_closed
    assert ros.flush()
    assert sorted(registrations.open) == sorted(
        "/robot/" + name for name in ("in", "many", "many", "more", "other", "out"))
    second[3].put(String("x"))
    assert handle.pending() == [second[3]]
    answers = []
    client = threading.Thread(target=lambda: answers.append(services["/robot/ask"](None)))
    client.start()
    wait_until(lambda: (scene_of_faults.requests.run_pending(), answers)[1], "the answer", 60.0)
    client.join()
    assert answers == ["new"]
    # A restart that fails halfway loses nothing either.
    handle.begin_restart()
    handle.publisher("out", String)
    handle.begin_restart()
    assert open_all("newest")[0] is first[0]
    handle.end_restart()
    handle.close()
    assert ros.flush() and registrations.open == [] and services == {}


def test_a_service_that_is_withdrawn_is_the_withdrawers_alone(objects, registrations):
    services = {name: objects.service(name, String, lambda request, name=name: (name, request))
                for name in ("/a", "/b")}
    services["/c"] = objects.service_in_thread("/c", String, lambda request: ("/c", request))
    assert objects.flush() and registrations.open == objects.served() == ["/a", "/b", "/c"]
    handlers = {name: objects.withdraw(name) for name in ("/a", "/c", "/nothing")}
    assert objects.served() == ["/b"]
    assert objects.flush() and registrations.open == ["/b"]
    assert handlers["/a"](1) == ("/a", 1) and handlers["/c"](2) == ("/c", 2) and handlers["/nothing"] is None
    for service in services.values():
        service.close()  # closing twice harms nobody
    assert objects.flush() and registrations.open == objects.served() == []


def test_a_topic_that_is_withdrawn_is_no_longer_heard(objects, registrations):
    queue = objects.subscription("/states", String, depth=3)
    objects.subscription("/more", String)
    assert objects.flush()
    assert objects.withdraw("/states") is None
    assert objects.flush() and registrations.open == ["/more"]
    assert queue.drain() == []


def test_the_end_of_a_connection_does_not_take_the_next_one_with_its_descriptor():
    """Its subscriber has left and come back, and the system has given the new connection the old one's descriptor."""
    impl = _PublisherImpl("/topic", String)
    impl.set_queue_size(None)
    remove_only_what_is_there(impl)

    def connected(endpoint):
        near, far = socket.socketpair()
        transport = TCPROSTransport(TCPROSPub("/topic", String), "/topic")
        transport.set_socket(near, endpoint)
        impl.add_connection(transport)
        return transport, far

    with contextlib.ExitStack() as ending:
        old, far = connected("/node")
        ending.callback(far.close)
        cleanup, old.cleanup_cb = old.cleanup_cb, None
        old.close()  # as another thread does, between closing the socket and its callback
        new, far = connected("/node")
        ending.callback(far.close)
        ending.callback(new.close)
        new._fileno = old.fileno()
        cleanup(old)
        assert impl.connections == [new]
        new.close()
        assert impl.connections == []
