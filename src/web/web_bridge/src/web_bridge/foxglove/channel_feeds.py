# SPDX-License-Identifier: BSD-3-Clause
"""Messages of channels on their way to clients: serialized bytes as they came, one subscription for all clients."""
from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any

from web_bridge.feeds import Latched
from web_bridge.foxglove.wire import message_frame, nanoseconds

if TYPE_CHECKING:
    from web_bridge.feeds import Arrival
    from web_bridge.foxglove.catalogue import Channel
    from web_bridge.foxglove.session import FoxgloveSession
    from web_bridge.graph import Graph, SubscribedTopic


class ChannelFeed:
    """One channel. A client needs ``send_message(frame)`` and ``tell_once(text)``."""

    def __init__(self, channel: Channel) -> None:
        self._channel = channel
        self._lock = threading.Lock()
        self._clients = {}  # client -> id of its subscription
        self._latched: Latched[Arrival] = Latched()
        self.subscription: SubscribedTopic | None = None

    def arrived(self, arrival: Arrival) -> None:
        """A message of ROS; on the thread that received it."""
        channel = self._channel
        fits = arrival.md5 in (channel.md5, "*")
        # The topic has got another type: it will be another channel, soon.
        if arrival.type not in (channel.type, "*") and arrival.md5 != channel.md5:
            return
        with self._lock:
            clients = list(self._clients.items())
            if fits:
                self._latched.keep(arrival, arrival)
        if not fits:
            for client, _ in clients:
                client.tell_once("messages of %s are not sent: the publisher %s has another definition of %s than this "
                                 "machine (MD5 %s, here %s)" % (channel.topic, arrival.publisher, channel.type,
                                                                arrival.md5, channel.md5))
            return
        frames = {}  # clients of the same program choose the same ids
        for client, number in clients:
            if number not in frames:
                frames[number] = _frame(number, arrival)
            client.send_message(frames[number])

    def add(self, client: FoxgloveSession, number: int) -> None:
        """A new client gets the latched messages of publishers that are still there."""
        with self._lock:
            arrivals = self._latched.of(self.subscription) if self.subscription is not None else []
            self._clients[client] = number
        for arrival in arrivals:
            client.send_message(_frame(number, arrival))

    def remove(self, client: FoxgloveSession) -> bool:
        """Returns whether another client is left."""
        with self._lock:
            self._clients.pop(client, None)
            return bool(self._clients)


def _frame(number: int, arrival: Arrival) -> bytes:
    return message_frame(number, nanoseconds(*arrival.received), arrival.data)


class ChannelFeeds:
    """The channels that clients hear. Changes of subscriptions come one at a time; messages from any thread."""

    def __init__(self, graph: Graph) -> None:
        self._graph = graph
        self._lock = threading.Lock()
        self._feeds = {}  # channel's id -> ChannelFeed

    def subscribe(self, client: FoxgloveSession, number: int, channel: Channel) -> None:
        """Raises BridgeError."""
        with self._lock:
            feed = self._feeds.get(channel.id)
            if feed is not None:
                feed.add(client, number)
                return
            feed = ChannelFeed(channel)
            feed.add(client, number)
            feed.subscription = self._graph.subscribe(channel.topic, feed.arrived)
            self._feeds[channel.id] = feed

    def unsubscribe(self, client: FoxgloveSession, channel_id: int) -> None:
        """The last client takes the subscription along."""
        with self._lock:
            feed = self._feeds.get(channel_id)
            if feed is not None and not feed.remove(client):
                self._feeds.pop(channel_id).subscription.close()

    def drop(self, channel_ids: tuple[int, ...]) -> None:
        """End the subscriptions of channels that have gone."""
        with self._lock:
            for channel_id in channel_ids:
                feed = self._feeds.pop(channel_id, None)
                if feed is not None:
                    feed.subscription.close()

    @property
    def channel_ids(self) -> list[Any]:
        with self._lock:
            return sorted(self._feeds)
