# SPDX-License-Identifier: BSD-3-Clause
"""A ROS graph without ROS's network: real message classes, topics and services in this process."""
import io
import threading

import genpy
import roslib.message

from web_bridge.codec import are_the_same
from web_bridge.errors import BridgeError, ServiceFailed, UnknownType
from web_bridge.feeds import Arrival


def message_class(type_name):
    cls = roslib.message.get_message_class(type_name)
    if cls is None:
        raise UnknownType("the message type %s is not here" % type_name)
    return cls


def serialized(message):
    buffer = io.BytesIO()
    message.serialize(buffer)
    return buffer.getvalue()


def now():
    return genpy.Time(12, 34)


class FakeGraph:
    """Delivers what is published to its own subscribers, on the publisher's thread. ``services`` {name: (type,
    handler)}.
    """

    def __init__(self, types=None):
        self.types = dict(types or {})
        self.subscribers = {}
        self.published = []
        self.publishers = {}
        self.alive = set()
        self.services = {}
        self.offered = {}
        self.changed = threading.Condition()

    def resolve(self, name):
        if not name or " " in name:
            raise BridgeError("%r is no legal name of ROS" % name)
        return name if name.startswith("/") else "/" + name

    def topic_type(self, topic):
        return self.types.get(self.resolve(topic))

    def published_topics(self):
        return dict(self.types)

    def check_type(self, topic, type_name):
        if type_name is not None:
            message_class(type_name)
            established = self.topic_type(topic)
            if established is not None and not are_the_same(message_class, established, type_name):
                raise BridgeError("%s has the type %s, not %s" % (topic, self.topic_type(topic), type_name))

    def subscribe(self, topic, arrived):
        with self.changed:
            self.subscribers.setdefault(self.resolve(topic), []).append(arrived)
            self.changed.notify_all()
        return FakeSubscription(self, self.resolve(topic), arrived)

    def advertise(self, topic, type_name, latched, queue_size):
        self.types.setdefault(self.resolve(topic), type_name)
        publisher = FakePublisher(self, self.resolve(topic), type_name)
        self.publishers[self.resolve(topic)] = publisher
        return publisher

    def call_service(self, service, fill, call):
        if self.resolve(service) not in self.services:
            raise ServiceFailed("service %s does not exist" % service)
        type_name, handler = self.services[self.resolve(service)]
        answers, over = [], threading.Event()

        def answer():
            try:
                answers.append(handler(fill(roslib.message.get_service_class(type_name)._request_class())))
            except Exception as error:
                answers.append(error)
            over.set()

        threading.Thread(target=answer, daemon=True).start()
        call.ends_by(over.set)
        over.wait()
        if not answers:
            raise ServiceFailed("service %s: the connection was closed" % service)
        if isinstance(answers[0], Exception):
            raise answers[0]
        return answers[0]

    def advertise_service(self, service, type_name, handler):
        cls = roslib.message.get_service_class(type_name)
        if cls is None:
            raise UnknownType("the service type %s is not here" % type_name)
        if self.resolve(service) in self.offered:
            raise BridgeError("this node offers %s already" % service)
        self.offered[self.resolve(service)] = lambda request: handler(request, cls._response_class)
        return FakeService(self, self.resolve(service))

    def send(self, topic, message, publisher="/robot", is_latched=False):
        """A message of another node."""
        arrival = Arrival(serialized(message), message._type, message._md5sum, (5, 6), publisher, is_latched)
        self.alive.add(publisher)
        for arrived in list(self.subscribers.get(topic, ())):
            arrived(arrival)


class FakeSubscription:
    def __init__(self, graph, topic, arrived):
        self.graph, self.topic, self.arrived = graph, topic, arrived

    def publishers(self):
        return self.graph.alive

    def close(self):
        self.graph.subscribers[self.topic].remove(self.arrived)
        if not self.graph.subscribers[self.topic]:
            del self.graph.subscribers[self.topic]


class FakePublisher:
    def __init__(self, graph, topic, type_name):
        self.graph, self.topic, self.type = graph, topic, type_name
        self.new_message = message_class(type_name)

    def publish(self, message):
        with self.graph.changed:
            self.graph.published.append((self.topic, message))
            self.graph.changed.notify_all()
        self.graph.send(self.topic, message, "/bridge")

    def close(self):
        del self.graph.publishers[self.topic]


class FakeService:
    def __init__(self, graph, service):
        self.graph, self.service = graph, service

    def close(self):
        self.graph.offered.pop(self.service, None)
