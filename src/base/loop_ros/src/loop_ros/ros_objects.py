# SPDX-License-Identifier: BSD-3-Clause
"""Topics and services of the loop, registered with the ROS master by a separate thread.

A registration is a round trip to the master (1 to 2 ms); a robot brings about a hundred. The objects are returned at
once and become active when they are registered, so the loop never waits; :meth:`RosObjects.flush` waits for all of
them.
"""
from __future__ import annotations

import queue
import threading
import weakref
from collections.abc import Callable
from typing import Any

import rospy

from loop_ros.faults import SURVIVED, Faults, described
from loop_ros.names import checked_name
from loop_ros.protocol import Log
from loop_ros.publisher import LoopPublisher, PublisherHub
from loop_ros.request_queue import LoopEnded, RequestQueue
from loop_ros.subscriber import PublisherConnection, SubscriberHub
from loop_ros.subscription import MessageQueue
from rospy_fixes.ports.messages import largest_message_bytes


def remapped(name: str) -> str:
    """The absolute ``name``, moved to where the node's remappings put its namespace, such as an action's name.

    roscpp's node handles do so; rospy remaps whole names alone, which it still does with the result. Raises
    ``loop_ros.names.IllegalName``.
    """
    space, _, last = checked_name(name).rpartition("/")
    return "%s/%s" % (rospy.resolve_name(space).rstrip("/"), last) if space else name


class RosObjects:
    """Makes publishers, subscriptions and services for the loop. Each raises ``loop_ros.names.IllegalName`` for a name
    that is none in ROS."""

    def __init__(self, publishers: PublisherHub, subscribers: SubscriberHub, requests: RequestQueue, log: Log,
                 faults: Faults) -> None:
        """``publishers``: :class:`PublisherHub`; ``subscribers``: :class:`SubscriberHub`; ``requests``:
        :class:`RequestQueue`; ``log``: :class:`LoopLog`; ``faults``: :class:`Faults`, counted by topic and service."""
        self._publishers = publishers
        self._subscribers = subscribers
        self._requests = requests
        self._log = log
        #: Public: other parts count their errors here too.
        self.faults = faults
        self._jobs: queue.SimpleQueue[Callable[[], object]] = queue.SimpleQueue()
        self._subscriptions: dict[str, list[MessageQueue]] = {}
        self._delivered_before: dict[str, int] = {}
        self._services: dict[str, _Service] = {}
        threading.Thread(target=self._work, name="ros_registrar", daemon=True).start()

    def publisher(self, topic: str, msg_class: type, latch: bool = False, greet: bool = False) -> LoopPublisher:
        """A :class:`LoopPublisher` for the absolute name ``topic``."""
        topic, registered = remapped(topic), []

        def register() -> None:
            if publisher.is_closed:
                return
            registration = rospy.Publisher(topic, msg_class, latch=latch, queue_size=1)
            registered.append(registration)
            # rospy would put a queue and a thread between us and each connection.
            impl: Any = registration.impl
            impl.set_queue_size(None)
            remove_only_what_is_there(impl)
            impl.add_subscriber_listener(_ConnectionNotice(self._publishers, publisher))
            publisher.attach(impl)

        def unregister() -> None:
            for registration in registered:
                registration.unregister()

        publisher = LoopPublisher(self._publishers, topic, msg_class, latch=latch, greet=greet,
                                  release=lambda: self._jobs.put(unregister))
        self._jobs.put(register)
        return publisher

    def subscription(self, topic: str, msg_class: type, depth: int = 1,
                     notice: Callable[[], object] = lambda: None) -> MessageQueue:
        """A :class:`MessageQueue` to ``topic``; ``notice()`` is called after each message, in any thread."""
        topic = remapped(topic)
        subscription = MessageQueue(depth, notice, self._counting(topic))
        self._subscriptions[topic] = [*self._subscriptions.get(topic, ()), subscription]
        registered = []

        def register() -> None:
            registration = rospy.Subscriber(topic, msg_class, subscription.put, tcp_nodelay=True)
            registered.append(registration)
            subscription.senders = registration.get_num_connections
            # If rospy made a connection before this line, rospy reads it in a separate thread.
            _read_in_loop(registration.impl, self._subscribers, self._log, self.faults)

        def unregister() -> None:
            for registration in registered:
                registration.unregister()

        def end() -> None:
            self._forget(topic, subscription)
            self._jobs.put(unregister)

        subscription.on_close = end
        self._jobs.put(register)
        return subscription

    def service(self, name: str, srv_class: type, handler: Callable[[Any], Any]) -> _Service:
        """Advertise ``name``; ``handler(request)`` runs in the loop thread."""
        return self._serve(name, srv_class, lambda request: self.call_in_loop(handler, request), handler)

    def service_in_thread(self, name: str, srv_class: type, handler: Callable[[Any], Any]) -> _Service:
        """Advertise ``name``; ``handler(request)`` runs in rospy's thread for the request."""
        return self._serve(name, srv_class, handler, handler)

    def served(self) -> list[str]:
        """Names of the services that are advertised now: a list."""
        return list(self._services)

    def subscribed(self) -> list[str]:
        """Names of the topics that are subscribed to now: a list."""
        return [topic for topic, subscriptions in list(self._subscriptions.items()) if subscriptions]

    def withdraw(self, name: str) -> Callable[[Any], Any] | None:
        """Loop thread: close the service ``name`` and all subscriptions to the topic ``name``, of all owners.

        Returns the service's handler, which from then on only the caller can use, or None if there is no such service.
        """
        name = remapped(name)
        for subscription in self._subscriptions.get(name, ()):
            subscription.close()
        service = self._services.get(name)
        if service is None:
            return None
        service.close()
        return service.handler

    def call_in_loop(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """Any thread but the loop's: call ``function(*arguments)`` in the loop between two ticks and wait for it.

        Raises ``rospy.ServiceException`` if the loop ends first, which makes a service request fail cleanly.
        """
        try:
            return self._requests.call(function, *arguments)
        except LoopEnded as error:
            raise rospy.ServiceException(str(error)) from None

    def deliveries(self) -> dict[str, int]:
        """How many messages the loop's subscriptions have received: {topic: count}. Closed subscriptions still count,
        so that a number never decreases."""
        return {topic: self._delivered_before.get(topic, 0) + sum(one.delivered for one in subscriptions)
                for topic, subscriptions in list(self._subscriptions.items())}

    def reads(self) -> int:
        """How often the loop has read the connections of its subscriptions."""
        return self._subscribers.reads

    def flush(self, timeout_s: float = 10.0) -> bool:
        """Any thread but the loop's: wait until all registrations asked for so far are done."""
        done = threading.Event()
        self._jobs.put(done.set)
        return done.wait(timeout_s)

    def later(self, function: Callable[[], object]) -> None:
        """Call ``function()`` in the registration thread."""
        self._jobs.put(function)

    def _serve(self, name: str, srv_class: type, answer_in_thread: Callable[[Any], Any],
               handler: Callable[[Any], Any]) -> _Service:
        name = remapped(name)
        service = self._services[name] = _Service(self, name, handler)

        def register() -> None:
            service.registration = rospy.Service(name, srv_class, answering(name, answer_in_thread, self.faults))

        self._jobs.put(register)
        return service

    def _counting(self, topic: str) -> Callable[[BaseException], None]:
        return lambda error: self.faults.note(topic, error, "the message is dropped")

    def _forget(self, topic: str, subscription: MessageQueue) -> None:
        self._delivered_before[topic] = self._delivered_before.get(topic, 0) + subscription.delivered
        left = [other for other in self._subscriptions.get(topic, ()) if other is not subscription]
        if left:
            self._subscriptions[topic] = left
        else:
            self._subscriptions.pop(topic, None)

    def _work(self) -> None:
        while True:
            job = self._jobs.get()
            try:
                job()
            except SURVIVED as error:  # what one topic meets must not keep the others from the master
                if not rospy.is_shutdown():
                    self.faults.note("registering with the ROS master", error)


def answering(name: str, handler: Callable[[Any], Any], faults: Faults) -> Callable[[Any], Any]:
    """``handler`` as rospy calls it: any exception is counted and returned to the client as an error."""

    def answer(request: Any) -> Any:
        try:
            return handler(request)
        except rospy.ServiceException:
            raise
        except SURVIVED as error:
            faults.note(name, error, "the request is answered with an error")
            raise rospy.ServiceException("%s failed: %s" % (name, described(error))) from error

    return answer


def remove_only_what_is_there(impl: Any) -> None:
    """Let rospy's publisher ``impl`` remove a connection once.

    A connection that ends is at times removed twice. rospy then looks for one with the same file descriptor, which may
    be that of a new subscriber by now: it would never get a message.
    """
    remove = impl.remove_connection

    def remove_connection(connection: Any) -> None:
        if connection in impl.connections:
            remove(connection)

    impl.remove_connection = remove_connection


def _read_in_loop(impl: Any, subscribers: SubscriberHub, log: Log, faults: Faults) -> None:
    """Let the loop read the connections of rospy's subscription ``impl``, as soon as they are made."""
    add = impl.add_connection

    def add_connection(connection: Any) -> Any:
        # A weak reference: if rospy drops a connection during its set-up, the socket closes only with the last
        # reference, and the publisher serves nobody else before that.
        held = weakref.ref(connection)
        connection.receive_loop = lambda _: _receive(held(), impl, subscribers, log, faults)
        return add(connection)

    impl.add_connection = add_connection


def _receive(transport: Any, impl: Any, subscribers: SubscriberHub, log: Log, faults: Faults) -> None:
    """Run in rospy's thread of the connection ``transport``: hand it to the loop and wait for its end."""

    def deliver(data: bytes) -> None:
        transport.stat_bytes += len(data)
        transport.stat_num_msg += 1
        try:
            message = impl.data_class().deserialize(data)
            message._connection_header = transport.header
            if transport.is_latched:
                transport.latch = message
            impl.receive_callback([message], transport)
        except Exception as error:  # noqa: BLE001  (a peer may send anything; the simulator goes on)
            if not impl.closed:
                faults.note(impl.resolved_name, error,
                            "a message from %s cannot be read and is dropped" % transport.callerid_pub)

    try:
        # The publisher may have sent its first, latched message together with the header.
        connection = PublisherConnection(transport.socket, deliver, largest_message_bytes(),
                                         held=transport.read_buff.getvalue())
    except (AttributeError, OSError):  # it has been closed already
        transport.close()
        return
    subscribers.add(connection)
    connection.ended.wait()
    if connection.fault:
        log.error("%s: the connection to %s is closed: %s"
                  % (impl.resolved_name, transport.callerid_pub, connection.fault))
    transport.close()


class _ConnectionNotice(rospy.SubscribeListener):
    """Notifies the loop of a publisher's new connection."""

    def __init__(self, hub: PublisherHub, publisher: LoopPublisher) -> None:
        self._hub = hub
        self._publisher = publisher

    def peer_subscribe(self, topic_name: str, topic_publish: Any, peer_publish: Any) -> None:
        self._hub.attention.append(self._publisher)


class _Service:
    """An advertised service. ``handler``: what answers a request."""

    def __init__(self, objects: RosObjects, name: str, handler: Callable[[Any], Any]) -> None:
        self.registration: rospy.Service | None = None
        self.handler = handler
        self._objects, self._name = objects, name
        self._is_closed = False

    def close(self) -> None:
        if self._is_closed:
            return
        self._is_closed = True
        if self._objects._services.get(self._name) is self:
            del self._objects._services[self._name]
        self._objects.later(self._unregister)

    def _unregister(self) -> None:
        if self.registration is not None:  # its registration may have failed
            self.registration.shutdown("closed")
