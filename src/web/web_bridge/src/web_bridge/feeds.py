# SPDX-License-Identifier: BSD-3-Clause
"""Topics on their way to clients: one subscription for all, each message converted once for each form that somebody
wants.

No ROS: the :class:`web_bridge.graph.Graph` is an argument.
"""
from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, TypeVar

from command_line.options import counted
from web_bridge.errors import BridgeError
from web_bridge.frames import cbor, json_text, packed_png, split

if TYPE_CHECKING:
    from genpy import Message

    from web_bridge.codec import Codec
    from web_bridge.graph import Graph, SubscribedTopic
    from web_bridge.loop_thread import Later
    from web_bridge.session import Session

_Message = TypeVar("_Message")
#: From the weakest to the strongest.
COMPRESSIONS = ("none", "png", "cbor", "cbor-raw")
#: Subscriptions of one client to one topic, which differ in their ids; each change looks at all of them.
MAX_OF_A_TOPIC = 1000
#: Bytes of latched messages that are kept for clients that subscribe later, for each publisher.
LARGEST_LATCHED = 64 << 20


class Arrival(NamedTuple):
    """A message as it came: serialized bytes, its type and sum, the time of receipt (secs, nsecs), its publisher."""

    data: bytes
    type: str
    md5: str
    received: tuple[int, int]
    publisher: str = ""
    is_latched: bool = False


class Wish(NamedTuple):
    """How one subscription wants its messages: milliseconds, messages, characters, one of COMPRESSIONS."""

    throttle_rate: float = 0
    queue_length: int = 0
    fragment_size: int = 0
    compression: str = "none"

    def joined(self, other: Wish) -> Wish:
        """The wish of a client with both subscriptions to one topic."""
        sizes = [size for size in (self.fragment_size, other.fragment_size) if size]
        return Wish(min(self.throttle_rate, other.throttle_rate), min(self.queue_length, other.queue_length),
                    min(sizes, default=0), max(self.compression, other.compression, key=COMPRESSIONS.index))


class Packet:
    """One message of a topic; converts itself when a form is first asked for. Not for two threads at a time."""

    def __init__(self, topic: str, arrival: Arrival, codec: Codec) -> None:
        self._topic = topic
        self._arrival = arrival
        self._codec = codec
        self._message: Message | None = None
        self._text: str | None = None
        self._frames: dict[tuple[str, int], Sequence[str | bytes]] = {}
        self._lock = threading.Lock()

    def frames(self, compression: str, fragment_size: int) -> Sequence[str | bytes]:
        """The frames of a form: texts, or one bytes object. Raises BridgeError where the message cannot be read."""
        form = (compression, 0 if compression.startswith("cbor") else fragment_size)
        with self._lock:
            if form not in self._frames:
                self._frames[form] = self._made(*form)
            return self._frames[form]

    def _made(self, compression: str, fragment_size: int) -> Sequence[str | bytes]:
        if compression == "cbor-raw":
            secs, nsecs = self._arrival.received
            return [self._publish_cbor({"bytes": self._arrival.data, "secs": secs, "nsecs": nsecs})]
        if self._message is None:
            self._message = self._codec.decoded(self._arrival)
        if compression == "cbor":
            return [self._publish_cbor(self._codec.cbor.values(self._message))]
        if self._text is None:
            values = self._codec.json.values(self._message)
            self._text = json_text({"op": "publish", "topic": self._topic, "msg": values})
        return split(packed_png(self._text) if compression == "png" else self._text, fragment_size)

    def _publish_cbor(self, values: dict[str, Any]) -> bytes:
        return cbor({"op": "publish", "topic": self._topic, "msg": values})


class ClientFeed:
    """One client's share of a topic: which messages, when. ``later(delay_s, function)`` returns a handle with
    ``cancel()``.
    """

    def __init__(self, client: Session, topic: str, later: Callable[[float, Callable[[], None]], Later],
                 clock: Callable[[], float]) -> None:
        self._client = client
        self._topic = topic
        self._later = later
        self._clock = clock
        self._lock = threading.Lock()
        self._wishes: dict[str | None, Wish] = {}
        self._wish: Wish | None = None
        self._due = 0.0
        self._waiting: deque[Packet] = deque()
        self._timer: Later | None = None
        self._told = ""

    def add(self, name: str | None, wish: Wish) -> None:
        """A subscription; one of the same name is replaced. Raises BridgeError for one too many."""
        with self._lock:
            if name not in self._wishes and len(self._wishes) >= MAX_OF_A_TOPIC:
                raise BridgeError("this client has %s to %s already; unsubscribe from those that are not "
                                  "needed any more" % (counted(len(self._wishes), "subscription"), self._topic))
            self._wishes[name] = wish
            self._join()

    def remove(self, name: str | None) -> bool:
        """Forget one subscription (None: all); returns whether one is left."""
        with self._lock:
            if name is None:
                self._wishes.clear()
            self._wishes.pop(name, None)
            self._join()
            return bool(self._wishes)

    def _join(self) -> None:
        self._wish = None
        for wish in self._wishes.values():
            self._wish = wish if self._wish is None else self._wish.joined(wish)
        self._waiting = deque(self._waiting, self._wish.queue_length or None) if self._wish else deque()
        if not self._waiting and self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def send(self, packet: Packet) -> None:
        """Send a message now, whatever the throttle says."""
        with self._lock:
            wish = self._wish
        if wish is not None:
            self._send(packet, wish)

    def offer(self, packet: Packet) -> None:
        """Send a message now, later or not at all."""
        with self._lock:
            wish = self._wish
            if wish is None:
                return
            now = self._clock()
            if wish.throttle_rate and (now < self._due or self._waiting):
                if wish.queue_length:
                    self._waiting.append(packet)
                    if self._timer is None:
                        self._timer = self._later(max(0.0, self._due - now), self._next)
                return
            self._due = now + wish.throttle_rate / 1000
        self._send(packet, wish)

    def _next(self) -> None:
        with self._lock:
            self._timer = None
            if not self._waiting or self._wish is None:
                return
            packet, wish = self._waiting.popleft(), self._wish
            self._due = self._clock() + wish.throttle_rate / 1000
            if self._waiting:
                self._timer = self._later(wish.throttle_rate / 1000, self._next)
        self._send(packet, wish)

    def _send(self, packet: Packet, wish: Wish) -> None:
        try:
            frames = packet.frames(wish.compression, wish.fragment_size)
        except BridgeError as error:
            # The same reason once, not with each message.
            if str(error) != self._told:
                self._told = str(error)
                self._client.status("error", "a message of %s is not sent: %s" % (self._topic, error), None)
            return
        self._client.outgoing.offer(frames, self._topic, wish.queue_length)


class Latched(Generic[_Message]):
    """The last latched message of each publisher of a topic, for clients that subscribe later. Its user locks."""

    def __init__(self) -> None:
        self._of: dict[str, _Message] = {}  # publisher -> message

    def keep(self, arrival: Arrival, message: _Message) -> None:
        """``message``: what :meth:`of` gives back for this arrival."""
        if arrival.is_latched and len(arrival.data) <= LARGEST_LATCHED:
            self._of[arrival.publisher] = message
        else:
            self._of.pop(arrival.publisher, None)

    def of(self, subscription: SubscribedTopic | None) -> list[_Message]:
        """The messages of publishers that are still connected."""
        if self._of and subscription is not None:
            alive = subscription.publishers()
            self._of = {name: message for name, message in self._of.items() if name in alive}
        return list(self._of.values())


class Feed:
    """One topic for all clients."""

    def __init__(self, topic: str, codec: Codec, later: Callable[[float, Callable[[], None]], Later],
                 clock: Callable[[], float]) -> None:
        self._topic = topic
        self._codec = codec
        self._later = later
        self._clock = clock
        self._lock = threading.Lock()
        self._clients: dict[Session, ClientFeed] = {}
        self._latched: Latched[Packet] = Latched()
        self.subscription: SubscribedTopic | None = None

    def arrived(self, arrival: Arrival) -> None:
        """A message of ROS; on the thread that received it."""
        packet = Packet(self._topic, arrival, self._codec)
        with self._lock:
            self._latched.keep(arrival, packet)
            clients = list(self._clients.values())
        for client in clients:
            client.offer(packet)

    def add(self, client: Session, name: str | None, wish: Wish) -> None:
        """A subscription of a client; each gets the latched messages of publishers that are still there."""
        with self._lock:
            share = self._clients.get(client)
            if share is None:
                share = self._clients[client] = ClientFeed(client, self._topic, self._later, self._clock)
            share.add(name, wish)
            packets = self._latched.of(self.subscription)
        for packet in packets:
            share.send(packet)

    def remove(self, client: Session, name: str | None = None) -> bool:
        """Forget one subscription of a client (None: all of its). Returns whether the client had any."""
        with self._lock:
            share = self._clients.get(client)
            if share is not None and not share.remove(name):
                del self._clients[client]
            return share is not None

    @property
    def is_idle(self) -> bool:
        with self._lock:
            return not self._clients


class Feeds:
    """The topics that clients hear. Changes of subscriptions come one at a time; messages from any thread."""

    def __init__(self, graph: Graph, codec: Codec, later: Callable[[float, Callable[[], None]], Later],
                 clock: Callable[[], float]) -> None:
        self._graph = graph
        self._codec = codec
        self._later = later
        self._clock = clock
        self._lock = threading.Lock()
        self._feeds: dict[str, Feed] = {}

    def subscribe(self, client: Session, name: str | None, topic: str, type_name: str | None, wish: Wish) -> None:
        """Raises BridgeError, for a type that is not the topic's, for instance."""
        with self._lock:
            feed = self._feeds.get(topic)
            if feed is not None and type_name is None:
                feed.add(client, name, wish)
                return
        # The master may be slow; other topics do not wait for it.
        self._graph.check_type(topic, type_name)
        with self._lock:
            feed = self._feeds.get(topic)
            if feed is not None:
                feed.add(client, name, wish)
                return
            feed = Feed(topic, self._codec, self._later, self._clock)
            feed.add(client, name, wish)
            feed.subscription = self._graph.subscribe(topic, feed.arrived)
            # Not before the subscription has worked: the next client tries again.
            self._feeds[topic] = feed

    def unsubscribe(self, client: Session, topic: str, name: str | None = None) -> bool:
        """Returns whether the client had a subscription to the topic. The last client takes the subscription along."""
        with self._lock:
            feed = self._feeds.get(topic)
            if feed is None or not feed.remove(client, name):
                return False
            if feed.is_idle:
                del self._feeds[topic]
                if feed.subscription is not None:
                    feed.subscription.close()
            return True

    def forget(self, client: Session) -> None:
        """End all subscriptions of a client."""
        with self._lock:
            topics = list(self._feeds)
        for topic in topics:
            self.unsubscribe(client, topic)

    @property
    def topics(self) -> list[str]:
        with self._lock:
            return sorted(self._feeds)
