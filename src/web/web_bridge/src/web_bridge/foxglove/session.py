# SPDX-License-Identifier: BSD-3-Clause
"""The operations of the Foxglove WebSocket protocol for one client. No ROS."""
from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from web_bridge.codec import deserialized, serialized
from web_bridge.errors import BridgeError, FieldError, RequestForbidden, ServiceFailed, shown
from web_bridge.fields import field
from web_bridge.foxglove import parameters as values
from web_bridge.foxglove import wire
from web_bridge.foxglove.wire import entries, number

if TYPE_CHECKING:
    from genpy import Message

    from web_bridge.foxglove.bridge import FoxgloveBridge
    from web_bridge.foxglove.catalogue import Channel, ServiceEntry
    from web_bridge.foxglove.rules import FoxgloveRules
    from web_bridge.outgoing import OutgoingBuffer
    from web_bridge.services import Call

#: How clients may publish; services have the first.
ENCODINGS = ("ros1", "json")
#: Topics that one client publishes, and parameters that it watches.
MAX_CHANNELS, MAX_PARAMETERS = 1000, 20000
_QUEUE = 100


class _ClientChannel:
    def __init__(self, topic: str, encoding: str) -> None:
        self.topic = topic
        self.encoding = encoding


class FoxgloveSession:
    """One client. ``outgoing`` is its OutgoingBuffer; frames come one at a time, from any thread."""

    def __init__(self, bridge: FoxgloveBridge, outgoing: OutgoingBuffer, rules: FoxgloveRules) -> None:
        self.outgoing = outgoing
        self._bridge = bridge
        self._rules = rules
        self._lock = threading.Lock()
        self._closed = False
        self._subscriptions = {}  # id -> channel's id
        self._subscribed = {}  # channel's id -> id
        self._channels = {}  # id -> _ClientChannel
        self._watched = set()
        self._told = set()

    # To the client; from any thread.

    def send(self, op: str, **fields: Any) -> None:
        """An answer, which is never dropped."""
        self.send_text(wire.text(op, **fields))

    def send_text(self, text: str) -> None:
        """A frame that many clients get; never dropped."""
        self.outgoing.keep([text])

    def send_message(self, frame: bytes) -> None:
        """A message of a topic: beyond the buffer's limit the oldest is dropped, and the client is told once."""
        dropped = self.outgoing.dropped
        self.outgoing.offer([frame])
        if self.outgoing.dropped > dropped:
            self.tell_once("messages are dropped: this client does not read them as fast as they come", wire.WARNING)

    def send_time(self, frame: bytes) -> None:
        self.outgoing.offer([frame], "time", 1)

    def status(self, level: int, text: str) -> None:
        # A client that floods with mistakes and reads nothing loses the oldest.
        self.outgoing.offer([wire.text("status", level=level, message=text)])

    def tell_once(self, text: str, level: int = wire.ERROR) -> None:
        """A status that this client gets once."""
        if text not in self._told and len(self._told) < 1000:
            self._told.add(text)
            self.status(level, text)

    def tell_fault(self, text: str) -> None:
        """The server failed at an operation."""
        self.status(wire.ERROR, text)

    def has(self, capability: str) -> bool:
        """May this client use a capability?"""
        return self._rules.has(capability)

    # From the client.

    def open(self) -> None:
        """Say what this server can do, and which channels there are."""
        options = self._bridge.options
        capabilities = [name for name in self._rules.capabilities if self.has(name)]
        self.send("serverInfo", name=options.name, capabilities=capabilities + ["time"] * options.sim_time,
                  supportedEncodings=list(ENCODINGS), metadata=options.metadata, sessionId=options.session_id)
        self._bridge.add(self)

    def is_quick(self, _frame: str | bytes) -> bool:
        """Nothing is served in the loop."""
        return False

    def handle(self, frame: str | bytes) -> None:
        """Serve a frame (text or bytes). Errors go to the client as status, never to the caller."""
        with self._lock:
            if self._closed:
                return
            try:
                if isinstance(frame, str):
                    self._serve_text(wire.read_text(frame))
                else:
                    self._serve_binary(wire.read_binary(frame))
            except BridgeError as error:
                self.status(wire.ERROR, str(error))

    def close(self) -> None:
        """The client has gone: withdraw everything of it."""
        self.outgoing.close()
        with self._lock:
            self._closed = True
            self._bridge.remove(self)
            self._bridge.calls.forget(self)
            for channel_id in self._subscriptions.values():
                self._bridge.feeds.unsubscribe(self, channel_id)
            self._bridge.publications.forget(self)

    def _serve_text(self, operation: dict[str, Any]) -> None:
        op = operation.get("op")
        serve = _OPERATIONS.get(op) if isinstance(op, str) else None
        if serve is None:
            raise FieldError("unknown op %s; known are %s" % (shown(op), ", ".join(sorted(_OPERATIONS))))
        try:
            serve(self, operation)
        except BridgeError as error:
            raise BridgeError("%s: %s" % (op, error)) from None

    def _serve_binary(self, request: wire.ClientMessage | wire.ServiceRequest) -> None:
        if isinstance(request, wire.ClientMessage):
            self._publish(request)
        else:
            self._call(request)

    def _each(self, op: str, all_entries: list[Any], serve: Callable[[Any], None], level: int = wire.ERROR) -> None:
        """Serve each entry of an operation; one status for all that fail."""
        first, failed = None, 0
        for entry in all_entries:
            try:
                serve(entry)
            except BridgeError as error:
                first, failed = first or error, failed + 1
        if failed:
            more = " (and %d more of %d)" % (failed - 1, len(all_entries)) if failed > 1 else ""
            self.status(level, "%s: %s%s" % (op, first, more))

    # Topics to the client

    def _subscribe(self, operation: dict[str, Any]) -> None:
        self._each("subscribe", entries(operation, "subscriptions", dict), self._subscribe_to)

    def _subscribe_to(self, entry: dict[str, Any]) -> None:
        name, channel_id = number(entry.get("id"), "id"), number(entry.get("channelId"), "channelId")
        channels = self._bridge.catalogue.channels
        channel = channels.get(channel_id)
        if channel is None:
            raise BridgeError("channel %d does not exist" % channel_id)
        if channel_id in self._subscribed:
            raise BridgeError("channel %d (%s) is subscribed to already, by subscription %d"
                              % (channel_id, channel.topic, self._subscribed[channel_id]))
        # A subscription whose channel has gone may be left by the client as it is.
        if name in self._subscriptions and self._subscriptions[name] in channels:
            raise BridgeError("a subscription with id %d exists already" % name)
        self._forget_gone(channels)
        self._bridge.feeds.subscribe(self, name, channel)
        self._subscriptions[name], self._subscribed[channel_id] = channel_id, name

    def _forget_gone(self, channels: dict[int, Channel]) -> None:
        for name, channel_id in list(self._subscriptions.items()):
            if channel_id not in channels:
                self._bridge.feeds.unsubscribe(self, channel_id)
                del self._subscriptions[name], self._subscribed[channel_id]

    def _unsubscribe(self, operation: dict[str, Any]) -> None:
        self._each("unsubscribe", entries(operation, "subscriptionIds", int), self._unsubscribe_from, wire.WARNING)

    def _unsubscribe_from(self, name: int) -> None:
        if name not in self._subscriptions:
            raise BridgeError("there is no subscription with id %s" % shown(name))
        channel_id = self._subscriptions.pop(name)
        del self._subscribed[channel_id]
        self._bridge.feeds.unsubscribe(self, channel_id)

    # Topics from the client

    def _advertise(self, operation: dict[str, Any]) -> None:
        self._rules.check("clientPublish")
        self._each("advertise", entries(operation, "channels", dict), self._advertise_one)
        self._bridge.look_soon()

    def _advertise_one(self, entry: dict[str, Any]) -> None:
        name, topic = number(entry.get("id"), "id"), field(entry, "topic", str)
        encoding, type_name = field(entry, "encoding", str), field(entry, "schemaName", str)
        if encoding not in ENCODINGS:
            raise FieldError("encoding is %s; %s are known" % (shown(encoding), " and ".join(ENCODINGS)))
        if name in self._channels:
            raise BridgeError("channel %d is advertised already, for %s" % (name, self._channels[name].topic))
        if len(self._channels) >= MAX_CHANNELS:
            raise BridgeError("this client publishes %d topics, which is the limit" % MAX_CHANNELS)
        topic = self._bridge.graph.resolve(topic)
        self._rules.check_publish(topic)
        self._bridge.publications.advertise(self, name, topic, type_name, (False, _QUEUE))
        self._channels[name] = _ClientChannel(topic, encoding)

    def _unadvertise(self, operation: dict[str, Any]) -> None:
        self._each("unadvertise", entries(operation, "channelIds", int), self._unadvertise_one, wire.WARNING)

    def _unadvertise_one(self, name: int) -> None:
        if name not in self._channels:
            raise BridgeError("this client does not advertise a channel %s" % shown(name))
        self._bridge.publications.unadvertise(self, self._channels.pop(name).topic, name)

    def _publish(self, message: wire.ClientMessage) -> None:
        self._rules.check("clientPublish")
        channel = self._channels.get(message.channel_id)
        if channel is None:
            raise BridgeError("this client does not advertise a channel %d" % message.channel_id)
        if channel.encoding == "json":
            def make(empty: Message) -> Message:
                return self._bridge.codec.reader.fill(empty, wire.read_text(message.data))
        else:
            # Read and written again: no subscriber gets bytes that are no message.
            def make(empty: Message) -> Message:
                return deserialized(empty, message.data)
        try:
            self._bridge.publications.publish_made(self, channel.topic, make)
        except BridgeError as error:
            raise BridgeError("%s: %s" % (channel.topic, error)) from None

    # Services

    def _call(self, request: wire.ServiceRequest) -> None:
        def fail(error: str | BridgeError) -> None:
            self.send("serviceCallFailure", serviceId=request.service_id, callId=request.call_id, message=str(error))

        def call(under_way: Call) -> None:
            try:
                self.outgoing.keep([wire.response_frame(request, self._answer(request, entry, under_way))])
            # A call always gets an answer; the graph runs code of others.
            except Exception as error:
                fail(str(error) or type(error).__name__)

        try:
            self._rules.check("services")
            if request.service_id not in self._bridge.catalogue.services:
                raise ServiceFailed("service %d does not exist" % request.service_id)
            entry = self._bridge.catalogue.services[request.service_id]
            if request.encoding != ENCODINGS[0]:
                raise ServiceFailed("encoding is %s; services are called in %s"
                                    % (shown(request.encoding), ENCODINGS[0]))
            self._bridge.calls.run(self, call)
        except BridgeError as error:
            fail(error)

    def _answer(self, request: wire.ServiceRequest, entry: ServiceEntry, under_way: Call) -> bytes:
        """On the thread of the call: the serialized response."""
        def fill(empty: Any) -> Message:
            if empty._type != entry.type + "Request":
                self._bridge.catalogue.forget_service(entry)
                raise ServiceFailed("service %s is no longer a %s" % (entry.name, entry.type))
            return deserialized(empty, request.data)
        return serialized(self._bridge.graph.call_service(entry.name, fill, under_way))

    # Parameters

    def _get_parameters(self, operation: dict[str, Any]) -> None:
        self._rules.check("parameters")
        names = entries(operation, "parameterNames", str)
        tree = self._bridge.parameters()
        if names:
            found = {}
            for name in map(self._bridge.graph.resolve, names):
                try:
                    found[name] = values.at(tree, name)
                except KeyError:
                    continue
        else:
            found = values.flattened(tree)
        self._send_parameters(found, field(operation, "id", str, None))

    def _send_parameters(self, found: dict[str, Any], name: str | None) -> None:
        seen = (values.shown_parameter(*one) for one in found.items() if self._may_see(*one))
        self.send("parameterValues", parameters=[one for one in seen if one is not None], id=name)

    def _may_see(self, name: str, value: Any) -> bool:
        return all(map(self._rules.shows_parameter, values.flattened(value, name)))

    def _set_parameters(self, operation: dict[str, Any]) -> None:
        name, done = field(operation, "id", str, None), {}

        def set_one(entry: dict[str, Any]) -> None:
            parameter = self._bridge.graph.resolve(field(entry, "name", str))
            done[parameter] = self._set(parameter, entry)
        try:
            self._each("setParameters", entries(operation, "parameters", dict), set_one)
        finally:
            for parameter, value in done.items():
                self._bridge.tell_parameter(parameter, value)
            if name is not None:
                self._send_parameters({one: value for one, value in done.items() if value != {}}, name)

    def _set(self, name: str, entry: dict[str, Any]) -> Any:
        values.check_name(name)
        graph = self._bridge.graph
        # A namespace is set or deleted with everything in it.
        try:
            before = values.flattened(values.at(graph.parameters(), name), name)
        except KeyError:
            before = {}
        value = {} if entry.get("value") is None else values.given_value(entry)
        for one in {name, *before, *values.flattened(value, name)}:
            self._rules.check_set_parameter(one)
        if entry.get("value") is None:
            graph.delete_parameter(name)
        else:
            graph.set_parameter(name, value)
        return value

    def _watch(self, operation: dict[str, Any]) -> None:
        self._rules.check("parametersSubscribe")
        names = {self._bridge.graph.resolve(name) for name in entries(operation, "parameterNames", str)}
        for name in names:
            self._rules.check_parameter(name)
        if len(self._watched | names) > MAX_PARAMETERS:
            raise RequestForbidden("a client may watch %d parameters" % MAX_PARAMETERS)
        self._watched |= names
        self._bridge.watch_parameters(self, sorted(names))

    def _leave(self, operation: dict[str, Any]) -> None:
        names = {self._bridge.graph.resolve(name) for name in entries(operation, "parameterNames", str)}
        self._watched -= names
        self._bridge.leave_parameters(self, names)

    # The graph, files

    def _follow_graph(self, _operation: dict[str, Any]) -> None:
        self._rules.check("connectionGraph")
        self._bridge.follow_graph(self)

    def _leave_graph(self, _operation: dict[str, Any]) -> None:
        self._bridge.leave_graph(self)

    def _fetch_asset(self, operation: dict[str, Any]) -> None:
        name = number(operation.get("requestId"), "requestId")
        try:
            uri = field(operation, "uri", str)
            self._rules.check_asset(uri)
            frame = wire.asset_frame(name, self._bridge.assets.read(uri))
        except BridgeError as error:
            frame = wire.asset_frame(name, error=str(error))
        self.outgoing.keep([frame])


_OPERATIONS = {
    "subscribe": FoxgloveSession._subscribe, "unsubscribe": FoxgloveSession._unsubscribe,
    "advertise": FoxgloveSession._advertise, "unadvertise": FoxgloveSession._unadvertise,
    "getParameters": FoxgloveSession._get_parameters, "setParameters": FoxgloveSession._set_parameters,
    "subscribeParameterUpdates": FoxgloveSession._watch, "unsubscribeParameterUpdates": FoxgloveSession._leave,
    "subscribeConnectionGraph": FoxgloveSession._follow_graph,
    "unsubscribeConnectionGraph": FoxgloveSession._leave_graph, "fetchAsset": FoxgloveSession._fetch_asset}
