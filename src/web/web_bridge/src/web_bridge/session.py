# SPDX-License-Identifier: BSD-3-Clause
"""The operations of rosbridge v2 for one client. No ROS: the :class:`web_bridge.graph.Graph` is an argument."""
from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from web_bridge.access import Rules
from web_bridge.codec import Codec
from web_bridge.errors import BridgeError, FieldError, shown
from web_bridge.feeds import COMPRESSIONS, Feeds, Wish
from web_bridge.fields import NUMBER, field, type_field
from web_bridge.frames import Fragments, cbor, from_base64, json_text, packed_png, read_frame, split, text_of_png
from web_bridge.publications import Publications
from web_bridge.services import CallPool, OfferedServices

if TYPE_CHECKING:
    from genpy import Message

    from web_bridge.graph import Graph
    from web_bridge.loop_thread import Later
    from web_bridge.outgoing import OutgoingBuffer
    from web_bridge.services import Call

LEVELS = ("none", "error", "warning", "info")
#: Characters of a text inside of fragments or a picture.
LARGEST_TEXT = 64 << 20
#: Operations inside of operations (png in fragments in png ...).
DEEPEST = 3


class BridgeOptions(NamedTuple):
    """``unregister_timeout``: a publisher stays that long after its last client [s]; ``fragment_timeout`` [s]."""

    unregister_timeout: float = 10.0
    fragment_timeout: float = 600.0


class Bridge:
    """State that all clients share."""

    def __init__(self, graph: Graph, codec: Codec, later: Callable[[float, Callable[[], None]], Later],
                 options: BridgeOptions | None = None, clock: Callable[[], float] = time.monotonic) -> None:
        self.options = options or BridgeOptions()
        self.clock = clock
        self.graph = graph
        self.codec = codec
        self.feeds = Feeds(graph, codec, later, clock)
        self.publications = Publications(graph, codec, later, self.options.unregister_timeout)
        self.services = OfferedServices(graph, codec)
        self.calls = CallPool()


class Session:
    """One client. ``outgoing`` is its OutgoingBuffer; frames come one at a time, from any thread."""

    def __init__(self, bridge: Bridge, outgoing: OutgoingBuffer, rules: Rules | None = None) -> None:
        self.outgoing = outgoing
        self._bridge = bridge
        self._rules = rules or Rules()
        self._level = "error"
        self._fragments = Fragments(bridge.clock, bridge.options.fragment_timeout)
        self._closed = False
        self._lock = threading.Lock()

    # To the client; from any thread.

    def send(self, operation: dict[str, Any]) -> None:
        """An answer, which is never dropped."""
        self.outgoing.keep([json_text(operation)])

    def status(self, level: str, text: str, name: Any) -> None:
        """Say something about the operation ``name`` (its id, or None) where the client's level asks for it."""
        if level == "none" or LEVELS.index(level) > LEVELS.index(self._level):
            return
        operation = {"op": "status", "level": level, "msg": text}
        if name is not None:
            operation["id"] = name
        # A client that floods with mistakes and reads nothing loses the oldest.
        self.outgoing.offer([json_text(operation)])

    def warn_of(self, subject: str, texts: list[str], name: Any) -> None:
        """Say what of ``subject`` was passed over, of the operation ``name``."""
        for text in texts:
            self.status("warning", "%s: passed over: %s" % (subject, text), name)

    def tell_fault(self, text: str) -> None:
        """The server failed at an operation."""
        self.status("error", text, None)

    # From the client.

    def handle(self, frame: str | bytes) -> None:
        """Serve all operations of a frame (text or bytes). Errors go to the client as status, never to the caller."""
        with self._lock:
            if self._closed:
                return
            try:
                operations = read_frame(frame)
            except BridgeError as error:
                self.status("error", str(error), None)
                return
            for operation in operations:
                self._serve(operation, 0)

    def is_quick(self, frame: str | bytes) -> bool:
        """Can this frame be served without waiting for the master? A small publish on an advertised topic can."""
        if not isinstance(frame, str) or len(frame) > 4096 or '"publish"' not in frame:
            return False
        try:
            operations = read_frame(frame)
        except BridgeError:
            return False
        return all(operation.get("op") == "publish" and isinstance(operation.get("topic"), str)
                   and self._bridge.publications.is_advertised(self, operation["topic"]) for operation in operations)

    def close(self) -> None:
        """The client has gone: withdraw everything of it."""
        self.outgoing.close()
        # Requests that wait for this client's answers end now: an operation of it may wait for them.
        self._bridge.services.forget(self)
        with self._lock:
            self._closed = True
            self._bridge.calls.forget(self)
            self._bridge.feeds.forget(self)
            self._bridge.publications.forget(self)
            self._bridge.services.forget(self)

    def _serve(self, operation: dict[str, Any], depth: int) -> None:
        name, op = operation.get("id"), operation.get("op")
        if not _is_plain(name) or (op in _FOUND_BY_ID and not isinstance(name, str | int | float | None)):
            self.status("error", "id is %s; a text or a finite number is expected" % shown(name), None)
            return
        serve = _OPERATIONS.get(op) if isinstance(op, str) else None
        if serve is None:
            self.status("error", "unknown op %s; known are %s" % (shown(op), ", ".join(sorted(_OPERATIONS))), name)
            return
        try:
            if op in ("fragment", "png"):
                serve(self, operation, depth)
            else:
                serve(self, operation, name)
        except BridgeError as error:
            self.status("error", "%s: %s" % (op, error), name)

    def _fragment(self, operation: dict[str, Any], depth: int) -> None:
        text = self._fragments.add(operation)
        if text is not None:
            self._unpacked(text, depth)

    def _png(self, operation: dict[str, Any], depth: int) -> None:
        self._unpacked(text_of_png(from_base64(operation.get("data")), LARGEST_TEXT), depth)

    def _unpacked(self, text: str, depth: int) -> None:
        if depth >= DEEPEST:
            raise FieldError("operations are packed into each other more than %d times" % DEEPEST)
        for operation in read_frame(text):
            self._serve(operation, depth + 1)

    def _set_level(self, operation: dict[str, Any], _name: Any) -> None:
        level = operation.get("level")
        if level not in LEVELS:
            raise FieldError("level is %s; %s are known" % (shown(level), ", ".join(LEVELS)))
        self._level = level

    def _advertise(self, operation: dict[str, Any], name: Any) -> None:
        topic, type_name = field(operation, "topic", str), type_field(operation)
        self._may_publish(topic)
        self._bridge.publications.advertise(self, name, topic, type_name, _publisher_options(operation))

    def _unadvertise(self, operation: dict[str, Any], name: int | None) -> None:
        topic = field(operation, "topic", str)
        if not self._bridge.publications.unadvertise(self, topic, name):
            self.status("warning", "unadvertise: %s is not advertised by this client" % topic, name)

    def _publish(self, operation: dict[str, Any], name: Any) -> None:
        topic = field(operation, "topic", str)
        self._may_publish(topic)
        unread = self._bridge.publications.publish(self, topic, operation.get("msg"), _publisher_options(operation))
        self.warn_of("publish on " + topic, unread, name)

    def _may_publish(self, topic: str) -> None:
        self._rules.check_may_act("publish")
        self._rules.check_topic(self._bridge.graph.resolve(topic))

    def _subscribe(self, operation: dict[str, Any], name: str | None) -> None:
        topic = field(operation, "topic", str)
        self._rules.check_topic(self._bridge.graph.resolve(topic))
        type_name = type_field(operation, None)
        wish = Wish(max(0, field(operation, "throttle_rate", NUMBER, 0)),
                    max(0, int(field(operation, "queue_length", NUMBER, 0))),
                    _fragment_size(operation), self._compression(operation, name))
        # "*" is how ROS writes: any type; and bytes are sent as they come, whatever the client calls them.
        is_any = type_name in ("", "*") or wish.compression == "cbor-raw"
        self._bridge.feeds.subscribe(self, name, topic, None if is_any else type_name, wish)

    def _unsubscribe(self, operation: dict[str, Any], name: str | None) -> None:
        topic = field(operation, "topic", str)
        if not self._bridge.feeds.unsubscribe(self, topic, name):
            self.status("warning", "unsubscribe: this client has no subscription to %s" % topic, name)

    def _call_service(self, operation: dict[str, Any], name: Any) -> None:
        service = field(operation, "service", str)
        # Old clients write the id behind the service's name.
        called, _, tag = service.partition("#")
        name = tag or None if name is None else name
        compression, size, args = self._compression(operation, name), _fragment_size(operation), operation.get("args")
        if args is not None and not isinstance(args, dict | list):
            self.warn_of("call_service of " + called, ["args is %s, neither an object nor a list" % shown(args)], name)
            args = None

        def answer(values: Any, worked: bool, in_cbor: dict[str, Any] | None = None) -> None:
            response = {"op": "service_response", "service": service, "values": values, "result": worked}
            if name is not None:
                response["id"] = name
            self.outgoing.keep(_packed(response, in_cbor or values, compression, size))

        def fill(request: Message) -> Message:
            unread = []
            self._bridge.codec.reader.fill(request, args, unread)
            self.warn_of("call_service of " + called, unread, name)
            return request

        def call(under_way: Call) -> None:
            try:
                response = self._bridge.graph.call_service(called, fill, under_way)
                answer(self._bridge.codec.json.values(response), True, self._bridge.codec.cbor.values(response))
            # A call always gets an answer; the graph runs code of others.
            except Exception as error:
                answer(str(error) or type(error).__name__, False)

        try:
            self._rules.check_service(self._bridge.graph.resolve(called))
            self._bridge.calls.run(self, call)
        except BridgeError as error:
            answer(str(error), False)

    def _advertise_service(self, operation: dict[str, Any], _name: Any) -> None:
        service, type_name = field(operation, "service", str), type_field(operation)
        self._rules.check_may_act("offer services")
        self._rules.check_service(self._bridge.graph.resolve(service))
        self._bridge.services.advertise(self, service, type_name)

    def _unadvertise_service(self, operation: dict[str, Any], name: str | None) -> None:
        service = field(operation, "service", str)
        self._rules.check_may_act("withdraw services")
        if not self._bridge.services.unadvertise(service):
            self.status("warning", "unadvertise_service: no client offers %s" % service, name)

    def _service_response(self, operation: dict[str, Any], name: str) -> None:
        # From any connection of a program: its requests may have come over another one.
        self._rules.check_may_act("answer for services")
        # A page may answer with anything true, or with values alone; without both it has failed.
        worked = bool(operation.get("result", "values" in operation))
        self._bridge.services.answer(self, name, worked, operation.get("values"))

    def _compression(self, operation: dict[str, Any], name: Any) -> str:
        compression = field(operation, "compression", str, "none")
        if compression in COMPRESSIONS:
            return compression
        self.warn_of(operation["op"], ["compression is %s, none of %s" % (shown(compression), ", ".join(COMPRESSIONS))],
                     name)
        return "none"

    def _auth(self, _operation: dict[str, Any], _name: Any):
        raise FieldError("this server does not use rosauth; where it has a token, it asks for it in the address "
                         "(?token=…)")


_OPERATIONS = {
    "fragment": Session._fragment, "png": Session._png, "set_level": Session._set_level, "auth": Session._auth,
    "advertise": Session._advertise, "unadvertise": Session._unadvertise, "publish": Session._publish,
    "subscribe": Session._subscribe, "unsubscribe": Session._unsubscribe, "call_service": Session._call_service,
    "advertise_service": Session._advertise_service, "unadvertise_service": Session._unadvertise_service,
    "service_response": Session._service_response}


#: Operations whose ids are compared with earlier ones; other ids are only handed back.
_FOUND_BY_ID = ("advertise", "unadvertise", "subscribe", "unsubscribe", "fragment", "service_response")


def _is_plain(name: Any) -> bool:
    """Has an id a form in JSON? NaN, infinities and bytes have none: no page could read the answer."""
    try:
        json.dumps(name, allow_nan=False)
    except (TypeError, ValueError, RecursionError):
        return False
    return True


def _fragment_size(operation: dict[str, Any]) -> int:
    return max(0, int(field(operation, "fragment_size", NUMBER, 0)))


def _publisher_options(operation: dict[str, Any]) -> tuple[bool, int]:
    return bool(operation.get("latch")), max(1, int(field(operation, "queue_size", NUMBER, 100)))


def _packed(response: dict[str, Any], in_cbor: Any, compression: str, fragment_size: int) -> Sequence[str | bytes]:
    if compression.startswith("cbor"):
        return [cbor({**response, "values": in_cbor})]
    text = json_text(response)
    return split(packed_png(text, response.get("id")) if compression == "png" else text, fragment_size)
