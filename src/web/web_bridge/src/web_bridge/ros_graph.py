# SPDX-License-Identifier: BSD-3-Clause
"""The graph of :mod:`web_bridge.session` in rospy. Only the modules ros_* know ROS."""
from __future__ import annotations

import socket
import threading
import time
from collections.abc import Callable
from io import BytesIO
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit
from xmlrpc.client import Error

import genpy
import rosgraph.network
import roslib.message
import rospy
import rosservice

from web_bridge.codec import are_the_same, serialized
from web_bridge.errors import BridgeError, ServiceFailed, UnknownType, shown
from web_bridge.feeds import Arrival
from web_bridge.publications import FirstMessages

if TYPE_CHECKING:
    from web_bridge.graph import AdvertisedTopic, Closable, SubscribedTopic
    from web_bridge.services import Call

#: What is published within this time after a topic was advertised also reaches subscribers that connect within it [s].
_FIRST_S = 1.0
_MAX_FIRST, _MAX_FIRST_BYTES = 100, 8 << 20
#: Age of the master's list of types that a new subscription is compared with [s]: a client with 1,000 subscriptions
#: does not ask for the whole list 1,000 times.
_TYPES_S = 0.2
_QUEUE = 100
#: A service that is asked what it is, not called; how long its answer may take [s].
PROBE = {"probe": "1", "md5sum": "*"}
_PROBE_S = 2.0
_CLOSING_S = 0.2  # between two tries to close the connection of a call that nobody waits for
_LONGEST_TEXT = 200  # of an error of others, which may quote all that a client sent


def message_class(type_name: str) -> type:
    """The class of a message type; raises UnknownType."""
    return _found(roslib.message.get_message_class, "message", type_name, "serialize")


def service_class(type_name: str) -> type:
    """The class of a service type; raises UnknownType."""
    return _found(roslib.message.get_service_class, "service", type_name, "_request_class")


def _found(load: Callable[[Any], Any], kind: str, type_name: str, attribute: str) -> type:
    try:
        cls = load(type_name)
    # Imports a module by its name, which may be any text and any module.
    except Exception as error:
        raise UnknownType("%s is no %s type: %s" % (shown(type_name), kind, str(error)[:_LONGEST_TEXT])) from None
    # A package's module has more in it than its types.
    if not hasattr(cls, attribute):
        raise UnknownType("the %s type %s is not on this machine; build its package and source the workspace"
                          % (kind, shown(type_name)))
    return cls


def now() -> genpy.Time:
    """ROS time; zero before /clock has begun."""
    return rospy.Time.now() if rospy.core.is_initialized() else genpy.Time()


def address_of(uri: str) -> tuple[str, int]:
    """(host, port) of a service's or node's address."""
    parts = urlsplit(uri)
    return parts.hostname or "", parts.port or 0


def handshake(address: tuple[str, int], header: dict[str, str], timeout_s: float) -> dict[str, str]:
    """The answer of the publisher or service at (host, port) to a header of TCPROS. Raises OSError and
    ROSHandshakeException.
    """
    with socket.create_connection(address, timeout_s) as connection:
        rosgraph.network.write_ros_handshake_header(connection, {**header, "callerid": rospy.get_name()})
        return rosgraph.network.read_ros_handshake_header(connection, BytesIO(), 65536)


def wait(seconds: float) -> bool:
    """Wait in wall time, because /clock may not run; False where the node ends."""
    rospy.rostime.wallsleep(seconds)
    return not rospy.is_shutdown()


class RosGraph:
    """Topics and services of the master."""

    def __init__(self) -> None:
        self._master = rosgraph.Master(rospy.get_name())
        self._lock = threading.Lock()  # xmlrpc's proxies serve one thread
        self._types, self._types_until = {}, 0.0

    def resolve(self, name: str) -> str:
        """Raises BridgeError for a text that is no name."""
        if not rosgraph.names.is_legal_name(name):
            raise BridgeError("%s is no legal name of ROS" % shown(name))
        resolved = rospy.resolve_name(name)
        # "" and "/"; the master refuses them, but only after rospy has kept a half-made topic.
        if resolved == "/":
            raise BridgeError("%s is a namespace; the name of a topic or service is expected" % shown(name))
        return resolved

    def topic_type(self, topic: str) -> str | None:
        return self._newest_types().get(self.resolve(topic))

    def published_topics(self) -> dict[str, str]:
        """The topics that have a publisher, {name: type}. Raises BridgeError."""
        return dict(self._ask("getPublishedTopics", "/"))

    def check_type(self, topic: str, type_name: str | None) -> None:
        if type_name is None:
            self.resolve(topic)
            return
        message_class(type_name)
        types = self._types if time.monotonic() < self._types_until else self._newest_types()
        if types.get(self.resolve(topic)) in (None, type_name):
            return
        # A list that is not the newest refuses nothing.
        established = self.topic_type(topic)
        if established is not None and not are_the_same(message_class, established, type_name):
            raise BridgeError("%s has the type %s, not %s" % (topic, established, type_name))

    def _newest_types(self) -> dict[str, str]:
        """{topic: established type} of now."""
        types = {name: kind for name, kind in self._ask("getTopicTypes") if kind != "*"}
        self._types, self._types_until = types, time.monotonic() + _TYPES_S
        return types

    def subscribe(self, topic: str, arrived: Callable[[Arrival], None]) -> SubscribedTopic:
        self.resolve(topic)
        return _Subscription(topic, arrived)

    def advertise(self, topic: str, type_name: str, latched: bool, queue_size: int) -> AdvertisedTopic:
        self.resolve(topic)
        return _Publisher(topic, type_name, latched, queue_size)

    def call_service(self, service: str, fill: Callable[[genpy.Message], genpy.Message], call: Call) -> genpy.Message:
        name = self.resolve(service)
        # Asked each time: a program that was restarted may offer another type.
        try:
            type_name = rosservice.get_service_type(name)
        except (rosservice.ROSServiceException, OSError) as error:
            raise ServiceFailed("service %s: %s" % (name, error)) from None
        if type_name is None:
            raise ServiceFailed("service %s does not exist" % name)
        cls = service_class(type_name)
        request = fill(cls._request_class())
        # Only of a persistent proxy can the connection be closed while it waits.
        proxy, is_over = rospy.ServiceProxy(name, cls, persistent=True), threading.Event()
        call.ends_by(lambda: threading.Thread(target=_close_until, args=(proxy, is_over), daemon=True).start())
        try:
            return proxy(request)
        except (rospy.ServiceException, rospy.ROSException, genpy.SerializationError, OSError) as error:
            raise ServiceFailed("service %s: %s" % (name, error)) from None
        finally:
            is_over.set()
            proxy.close()

    def advertise_service(self, service: str, type_name: str,
                          handler: Callable[[genpy.Message, Callable[[], genpy.Message]], genpy.Message]) -> Closable:
        name, cls = self.resolve(service), service_class(type_name)
        self._check_is_free(name)

        def answer(request: genpy.Message) -> genpy.Message:
            try:
                return handler(request, cls._response_class)
            except ServiceFailed as error:
                raise rospy.ServiceException(str(error)) from None
        try:
            return _Service(rospy.Service(name, cls, answer))
        except rospy.service.ServiceException as error:
            raise BridgeError("service %s: %s" % (name, error)) from None

    def _check_is_free(self, service: str) -> None:
        """Raise BridgeError where another node offers the service: the master would give the name to the newcomer."""
        others = set(dict(self._ask("getSystemState")[2]).get(service, ())) - {rospy.get_name()}
        if not others:
            return
        try:
            handshake(address_of(self._ask("lookupService", service)), {**PROBE, "service": service}, _PROBE_S)
        except ConnectionRefusedError:
            return  # that node has crashed: it is still registered, and nobody listens
        except (OSError, rosgraph.network.ROSHandshakeException):
            pass  # it hangs, or its machine is out of reach, and it may come back
        raise BridgeError("the node %s offers the service %s already; choose another name"
                          % (", ".join(sorted(others)), service))

    def _ask(self, method: str, *arguments) -> Any:
        try:
            with self._lock:
                return getattr(self._master, method)(*arguments)
        except rosgraph.MasterError as error:
            raise BridgeError("the ROS master refuses %s: %s" % (method, error)) from None
        except (OSError, rosgraph.MasterException, Error) as error:
            raise BridgeError("the ROS master does not answer: %s" % error) from None


_OF_BYTES = ("_connection_header", "_buff", "_read")


class Bytes(rospy.AnyMsg):
    """A message of any type, as it came, which reads itself when somebody asks for a field.

    All subscribers of a topic in one process get objects of the class that the first one asked for, and others in this
    process ask for fields: of tf, for instance.
    """

    __slots__ = ["_read"]

    def __init__(self) -> None:
        super().__init__()
        self._read = None

    # Those of genpy.Message keep the slots of the class alone: what a copy, as RobotEnable makes, would have to read.
    def __getstate__(self) -> list[Any]:
        return [getattr(self, name, None) for name in _OF_BYTES]

    def __setstate__(self, state: list[Any]) -> None:
        for name, value in zip(_OF_BYTES, state, strict=True):
            setattr(self, name, value)

    def __getattr__(self, name: str) -> list[genpy.Message]:
        # Fields have no such names; copies and headers are asked for before there is anything to read.
        if name.startswith("_"):
            raise AttributeError(name)
        if self._read is None:
            self._read = message_class(self._connection_header.get("type", "*"))().deserialize(self._buff)
        return getattr(self._read, name)


class _Subscription:
    def __init__(self, topic: str, arrived: Callable[[Arrival], None]) -> None:
        self._arrived = arrived
        self._subscriber = rospy.Subscriber(topic, Bytes, self._on_message, queue_size=_QUEUE, tcp_nodelay=True)

    def _on_message(self, message: genpy.Message) -> None:
        header, received = message._connection_header, rospy.Time.now()
        # Under simulated time rospy has subscribed to /clock itself, and delivers that class to everybody.
        data: Any = message._buff if isinstance(message, rospy.AnyMsg) else serialized(message)
        self._arrived(Arrival(data, header.get("type", "*"), header.get("md5sum", "*"),
                              (received.secs, received.nsecs), header.get("callerid", ""),
                              header.get("latching", "0") == "1"))

    def publishers(self) -> set[str]:
        implementation: Any = self._subscriber.impl
        return {connection.callerid_pub for connection in implementation.connections}

    def close(self) -> None:
        self._subscriber.unregister()


class _Publisher(rospy.SubscribeListener):
    def __init__(self, topic: str, type_name: str, latched: bool, queue_size: int) -> None:
        self.type = type_name
        self.new_message = message_class(type_name)
        self._lock = threading.Lock()
        self._until = time.monotonic() + _FIRST_S
        self._first = None if latched else FirstMessages(_MAX_FIRST, _MAX_FIRST_BYTES)
        self._publisher = rospy.Publisher(topic, self.new_message, subscriber_listener=self, latch=latched,
                                          queue_size=queue_size, tcp_nodelay=True)

    def peer_subscribe(self, _topic: str, _publish: Callable[[genpy.Message], None],
                       peer_publish: Callable[[genpy.Message], None]) -> None:
        """A subscriber has connected; on rospy's thread."""
        with self._lock:
            if time.monotonic() >= self._until:
                self._first = None
            first = self._first.messages() if self._first is not None else ()
        for message in first:
            peer_publish(message)

    def publish(self, message: genpy.Message) -> None:
        """Raises BridgeError where the message cannot be serialized."""
        try:
            self._keep_first(message)
            self._publisher.publish(message)
        except (rospy.ROSException, genpy.MessageException) as error:
            raise BridgeError("%s: %s" % (self._publisher.name, error)) from None

    def _keep_first(self, message: genpy.Message) -> None:
        with self._lock:
            if time.monotonic() >= self._until:
                self._first = None
            if self._first is not None:
                self._first.add(message, len(serialized(message)))

    def close(self) -> None:
        self._publisher.unregister()


def _close_until(proxy: rospy.ServiceProxy, is_over: threading.Event) -> None:
    """Close the proxy's connection, which it may be about to make, until the call is over."""
    while not is_over.is_set():
        proxy.close()
        is_over.wait(_CLOSING_S)


class _Service:
    def __init__(self, service: rospy.Service) -> None:
        self._service = service

    def close(self) -> None:
        self._service.shutdown("the client that offered it has gone")
