# SPDX-License-Identifier: BSD-3-Clause
"""Topics that clients publish: one publisher for all of them, which stays a while after the last has gone. No ROS."""
from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from web_bridge.codec import are_the_same
from web_bridge.errors import BridgeError, NoSuchTopic

if TYPE_CHECKING:
    from web_bridge.codec import Codec
    from web_bridge.foxglove.session import FoxgloveSession
    from web_bridge.graph import AdvertisedTopic, Graph
    from web_bridge.loop_thread import Later
    from web_bridge.session import Session


class FirstMessages:
    """The newest messages of a topic, at most ``most`` and ``most_bytes``, but always the newest one. Its user
    locks.
    """

    def __init__(self, most: int, most_bytes: int) -> None:
        self._limits = most, most_bytes
        self._kept = deque()  # (message, bytes)
        self._bytes = 0

    def add(self, message: Any, size: int) -> None:
        """``size``: of the serialized message [bytes]."""
        self._kept.append((message, size))
        self._bytes += size
        while len(self._kept) > 1 and (len(self._kept) > self._limits[0] or self._bytes > self._limits[1]):
            self._bytes -= self._kept.popleft()[1]

    def messages(self) -> list[Any]:
        """The oldest first."""
        return [message for message, _ in self._kept]


class _Publication:
    def __init__(self, publisher: AdvertisedTopic) -> None:
        self.publisher = publisher
        self.names = {}  # client -> its ids
        self.timer = None


class Publications:
    """``later(delay_s, function)`` returns a handle with ``cancel()``; a publisher is closed ``linger_s`` after its
    last client.
    """

    def __init__(self, graph: Graph, codec: Codec, later: Callable[[float, Callable[[], None]], Later],
                 linger_s: float) -> None:
        self._graph = graph
        self._codec = codec
        self._later = later
        self._linger_s = linger_s
        self._lock = threading.Lock()
        self._publications = {}

    def advertise(self, client: Session | FoxgloveSession, name: Any, topic: str, type_name: str,
                  options: tuple[bool, int]) -> None:
        """``options`` (latched, queue size) count for the first client of a topic. Raises BridgeError."""
        with self._lock:
            found = self._publications.get(topic)
        if found is None or not self._fits(found, type_name):
            self._graph.check_type(topic, type_name)
        with self._lock:
            found = self._publications.get(topic)
            if found is not None and not self._fits(found, type_name):
                if found.names:
                    raise BridgeError("%s has the type %s here, not %s" % (topic, found.publisher.type, type_name))
                self._close(topic)
                found = None
            if found is None:
                found = self._publications[topic] = _Publication(self._graph.advertise(topic, type_name, *options))
            if found.timer is not None:
                found.timer.cancel()
                found.timer = None
            found.names.setdefault(client, set()).add(name)

    def _fits(self, publication: _Publication, type_name: str) -> bool:
        return are_the_same(self._codec.class_of, publication.publisher.type, type_name)

    def unadvertise(self, client: Session | FoxgloveSession, topic: str, name: int | None = None) -> bool:
        """Forget one advertisement of a client (None: all of its). Returns whether there was one."""
        with self._lock:
            found = self._publications.get(topic)
            if found is None or client not in found.names:
                return False
            found.names[client].discard(name)
            if name is None or not found.names[client]:
                del found.names[client]
            if not found.names and found.timer is None:
                found.timer = self._later(self._linger_s, lambda: self._expire_soon(topic, found))
            return True

    def forget(self, client: Session | FoxgloveSession) -> None:
        """End all advertisements of a client."""
        with self._lock:
            topics = list(self._publications)
        for topic in topics:
            self.unadvertise(client, topic)

    def publish(self, client: Session, topic: str, values: Any, options: tuple[bool, int]) -> list[str]:
        """Publish ``values`` (a dict); a topic that the client did not advertise needs a known type. Returns what of
        them was not read, as texts. Raises BridgeError.
        """
        publisher = self._publisher(client, topic)
        if publisher is None:
            type_name = self._graph.topic_type(topic)
            if type_name is None:
                raise NoSuchTopic("the type of %s is not known: advertise it first" % topic)
            self.advertise(client, None, topic, type_name, options)
            publisher = self._publications[topic].publisher
        unread: list[str] = []
        publisher.publish(self._codec.reader.fill(publisher.new_message(), values, unread))
        return unread

    def publish_made(self, client: FoxgloveSession, topic: str, make: Callable[[Any], Any]) -> None:
        """Publish ``make(empty message)`` on a topic that the client has advertised. Raises BridgeError."""
        publisher = self._publisher(client, topic)
        if publisher is None:
            raise NoSuchTopic("%s is not advertised by this client" % topic)
        publisher.publish(make(publisher.new_message()))

    def _publisher(self, client: Session | FoxgloveSession, topic: str) -> AdvertisedTopic | None:
        # Without the lock, which another thread may hold while it waits for the master.
        found = self._publications.get(topic)
        return found.publisher if found is not None and client in found.names else None

    def is_advertised(self, client: Session, topic: str) -> bool:
        """Whether :meth:`publish` needs no answer of the master."""
        return self._publisher(client, topic) is not None

    def _expire_soon(self, topic: str, publication: _Publication) -> None:
        # The caller is the loop that serves all sockets; closing a publisher waits for the master.
        threading.Thread(target=self._expire, args=(topic, publication), daemon=True).start()

    def _expire(self, topic: str, publication: _Publication) -> None:
        with self._lock:
            if self._publications.get(topic) is publication and not publication.names:
                self._close(topic)

    def _close(self, topic: str) -> None:
        publication = self._publications.pop(topic)
        if publication.timer is not None:
            publication.timer.cancel()
        publication.publisher.close()
