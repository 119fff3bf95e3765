# SPDX-License-Identifier: BSD-3-Clause
"""A Foxglove server on a free port of this machine in front of a fake graph, and clients of another implementation."""
import json
import struct

import roslib.message
from fake_graph import FakeGraph, message_class, now, serialized
from web_lab import AnyClient, Lab

from web_bridge.access import Access
from web_bridge.codec import Codec
from web_bridge.errors import BridgeError
from web_bridge.foxglove.bridge import FoxgloveBridge, FoxgloveOptions
from web_bridge.foxglove.catalogue import GraphState
from web_bridge.foxglove.parameters import at
from web_bridge.foxglove.rules import FoxgloveRules
from web_bridge.foxglove.socket import FoxgloveSocket
from web_bridge.foxglove.wire import SUBPROTOCOLS
from web_bridge.loop_thread import LoopThread
from web_bridge.websocket import SocketOptions


class FakeFoxgloveGraph(FakeGraph):
    """Adds the master's state and parameters. ``nodes`` {topic: publishers}; ``tree``: the parameters; ``packages``
    {name: folder}.
    """

    def __init__(self, types=None):
        super().__init__(types)
        self.nodes = {topic: ["/robot"] for topic in self.types}
        self.tree = {}
        self.packages = {}
        self.watched = set()
        self._changed = None

    def publish_topic(self, topic, type_name):
        """From now on a node publishes a topic."""
        self.types = {**self.types, topic: type_name}
        self.nodes = {**self.nodes, topic: ["/robot"]}

    def end_topic(self, topic):
        self.nodes = {name: nodes for name, nodes in self.nodes.items() if name != topic}

    def state(self):
        published = {**self.nodes, **{topic: ["/bridge"] for topic in list(self.publishers)}}
        return GraphState(published, {topic: ["/bridge"] for topic in list(self.subscribers)},
                          {name: ["/robot"] for name in list(self.services)}, dict(self.types))

    def message_schema(self, topic, type_name):
        cls = message_class(type_name)
        return cls._full_text, cls._md5sum

    def service_schema(self, service):
        cls = roslib.message.get_service_class(self.services[service][0])
        return self.services[service][0], cls._request_class._full_text, cls._response_class._full_text

    def parameters(self):
        return self.tree

    def set_parameter(self, name, value):
        *path, key = name.strip("/").split("/")
        place = self.tree
        for part in path:
            place = place.setdefault(part, {})
        place[key] = value

    def delete_parameter(self, name):
        *path, key = name.strip("/").split("/")
        try:
            del (at(self.tree, "/".join(path)) if path else self.tree)[key]
        except KeyError:
            raise BridgeError("the ROS master refuses deleteParam: %s is not set" % name) from None

    def on_parameter(self, changed):
        self._changed = changed

    def watch_parameter(self, name):
        self.watched.add(name)

    def change_parameter(self, name, value):
        """Another node sets a parameter; {}: deletes it."""
        if name in self.watched:
            self._changed(name, value)

    def package_folder(self, name):
        return self.packages.get(name)


class FoxgloveLab(Lab):
    def __init__(self, graph=None, access=None, rules=None, sim_time=False, **options):
        self.graph = graph or FakeFoxgloveGraph()
        self.rules = rules or FoxgloveRules()
        loop = LoopThread()
        shared = FoxgloveOptions("/bridge", "s1", {"ROS_DISTRO": "one"}, 0.5, sim_time, 0.1)
        bridge = FoxgloveBridge(self.graph, Codec(message_class, now), loop.later, self.rules, shared)
        options = SocketOptions(access or Access(names=[]), self.rules, **options)
        super().__init__(loop, bridge, options, FoxgloveClient, FoxgloveSocket)

    def connect(self, query="", subprotocols=SUBPROTOCOLS[:1], **options):
        return super().connect(query, subprotocols=subprotocols, **options)

    def close(self):
        self.bridge.close()
        super().close()


class FoxgloveClient(AnyClient):
    REASON = "message"

    def __init__(self, socket):
        super().__init__(socket)
        self.channels = {}  # topic -> channel
        self.services = {}  # name -> service

    def receive(self):
        """The next frame: a dict; a binary one as {"op": its number, "data": the rest}. Keeps book of channels."""
        frame = self.frame()
        if isinstance(frame, bytes):
            return {"op": frame[0], "data": frame[1:]}
        operation = json.loads(frame)
        for one in operation.get("channels", ()):
            assert one["id"] not in [known["id"] for known in self.channels.values()]
            self.channels[one["topic"]] = one
        for one in operation.get("services", ()):
            self.services[one["name"]] = one
        self.channels = {topic: one for topic, one in self.channels.items()
                         if one["id"] not in operation.get("channelIds", ())}
        return operation

    def next(self, op):
        return self.until(lambda frame: frame["op"] == op)

    def channel(self, topic):
        """The id of a topic's channel, once there is one."""
        while topic not in self.channels:
            self.next("advertise")
        return self.channels[topic]["id"]

    def service(self, name):
        while name not in self.services:
            self.next("advertiseServices")
        return self.services[name]["id"]

    def subscribe(self, topic, number=0):
        self.send("subscribe", subscriptions=[{"id": number, "channelId": self.channel(topic)}])
        self.echo()
        return number

    def message(self):
        """(subscription, receive time [ns], serialized message) of the next message."""
        data = self.next(1)["data"]
        return (*struct.unpack_from("<IQ", data), data[12:])

    def publish(self, number, data):
        self.socket.send_binary(struct.pack("<BI", 1, number) + data)

    def call(self, service, call_id, request, encoding=b"ros1"):
        data = request if isinstance(request, bytes) else serialized(request)
        self.socket.send_binary(struct.pack("<BIII", 2, service, call_id, len(encoding)) + encoding + data)

    def error(self):
        """The text of the next status."""
        return self.next("status")["message"]
