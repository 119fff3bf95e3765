# SPDX-License-Identifier: BSD-3-Clause
"""One owner's topics and services: made below a namespace, closed together, and kept when the owner restarts."""
from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from loop_ros.protocol import LoopRos, Publisher, Service, Subscription

#: What it is (kind, name, type ...), the object, whether it is closed with the others.
_Opened = tuple[tuple[Any, ...], Any, bool]


class NodeHandle:
    """Topics and services of one owner, such as a plugin.

    Every owner may use the methods of ``loop_ros.protocol.Topics``; the others are for plugins. ``namespace``:
    absolute, without trailing slash ("" for the root namespace).
    """

    def __init__(self, ros: LoopRos, namespace: str = "") -> None:
        """``ros``: makes the objects from absolute names, a ``loop_ros.protocol.LoopRos``."""
        self.namespace = namespace
        self._ros = ros
        self._opened: list[_Opened] = []
        self._kept: list[_Opened] = []  # of the owner before; see `begin_restart`
        self._subscriptions: list[Subscription] = []
        self._noted: set[int] = set()  # the numbers of those that got messages

    def resolve(self, name: str) -> str:
        """Absolute ROS name: relative names live in the handle's namespace."""
        if name.startswith("/"):
            return name
        return "%s/%s" % (self.namespace, name)

    def publisher(self, topic: str, msg_class: type, latch: bool = False) -> Publisher:
        """A ``loop_ros.protocol.Publisher``: ``has_listeners`` and ``publish`` are for the loop."""
        name = self.resolve(topic)
        return self._opening(("publisher", name, msg_class, latch),
                             lambda: self._ros.publisher(name, msg_class, latch=latch))

    def subscription(self, topic: str, msg_class: type, depth: int = 1) -> Subscription:
        """A ``loop_ros.protocol.Subscription``, which keeps the newest ``depth`` unread messages.

        ``handle(function)`` calls ``function(message)`` for each of them, oldest first, and drops and counts a message
        for which it raises. Unguarded: ``drain()`` -> list of them; ``take()`` -> the newest or None.
        """
        name = self.resolve(topic)

        def make() -> Any:
            number = len(self._subscriptions)
            self._subscriptions.append(
                self._ros.subscription(name, msg_class, depth, lambda: self._noted.add(number)))
            return self._subscriptions[number]

        return self._opening(("subscription", name, msg_class, depth), make)

    def pending(self) -> Sequence[Subscription]:
        """Loop thread: the subscriptions that got messages since the last call, in the order they were opened.

        For owners with so many subscriptions that polling each one at every tick takes time.
        """
        if not self._noted:
            return ()
        numbers = sorted(self._noted)
        # Cleared before the queues are read: a message that arrives from here on is reported in the next call.
        self._noted.difference_update(numbers)
        return [self._subscriptions[number] for number in numbers]

    def reads(self) -> int:
        """Loop thread: how often the loop has read what has come for its subscriptions. It does so before a tick, but
        not before each one while several follow each other at once."""
        return self._ros.reads()

    def service(self, name: str, srv_class: type, handler: Callable[[Any], Any]) -> Service:
        """Advertise a service; ``handler(request)`` runs in the loop thread between two ticks."""
        return self._serving(self._ros.service, self.resolve(name), srv_class, handler)

    def service_in_thread(self, name: str, srv_class: type, handler: Callable[[Any], Any]) -> Service:
        """Advertise a slow service; ``handler(request)`` runs in a separate thread.

        It may use the objects of the loop through :meth:`call_in_loop` only.
        """
        return self._serving(self._ros.service_in_thread, self.resolve(name), srv_class, handler)

    def call_in_loop(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """Any thread but the loop's: call ``function(*arguments)`` in the loop, between two ticks, and return its
        result or raise its error. Raises ``rospy.ServiceException`` if the loop ends first."""
        return self._ros.call_in_loop(function, *arguments)

    def flush(self) -> None:
        """Any thread but the loop's: wait until the topics and services opened so far are known to the ROS master."""
        self._ros.flush()

    def branch(self) -> NodeHandle:
        """A handle in the same namespace, for a part of the owner that is opened and closed separately."""
        return NodeHandle(self._ros, self.namespace)

    def served(self) -> list[str]:
        """Absolute names of all services that the node serves now, of all owners: a list."""
        return self._ros.served()

    def subscribed(self) -> list[str]:
        """Absolute names of all topics that the node subscribes to in the loop now, of all owners: a list."""
        return self._ros.subscribed()

    def withdraw(self, name: str) -> Callable[[Any], Any] | None:
        """Loop thread: close the service ``name`` and all subscriptions to the topic ``name``, of all owners,
        permanently. For an owner that restricts what clients may do.

        Returns the service's handler, so that the caller can still use it, or None if there is no such service.
        """
        return self._ros.withdraw(self.resolve(name))

    def survived(self, place: str, error: BaseException) -> None:
        """Count an error that the owner has handled: it appears in /diagnostics and, at a limited rate, in the log.

        ``place``: the topic or service, or what the owner was doing, in words.
        """
        self._ros.faults.note(place, error)

    def begin_restart(self) -> None:
        """Until :meth:`end_restart`, opening a topic or service of the same name and type returns the one that is
        already open."""
        self._kept, self._opened = [*self._kept, *self._opened], []

    def end_restart(self) -> None:
        """Close what was open before :meth:`begin_restart` and has not been opened again."""
        kept, self._kept = self._kept, []
        _close_all(kept)

    def close(self) -> None:
        """Close every topic and service that was opened through this handle."""
        opened, self._opened, self._kept = [*self._kept, *self._opened], [], []
        _close_all(opened)

    def _opening(self, what: tuple[Any, ...], make: Callable[[], Any], closes: bool = True) -> Any:
        """The object that was opened earlier under the key ``what``, or a new one; ``closes``: whether :meth:`close`
        closes it."""
        for entry in self._kept:
            if entry[0] == what:
                self._kept.remove(entry)
                break
        else:
            entry = what, make(), closes
        self._opened.append(entry)
        return entry[1]

    def _serving(self, advertise: Callable[[str, type, Callable[[Any], Any]], Service], name: str, srv_class: type,
                 handler: Callable[[Any], Any]) -> Service:
        def make() -> Any:
            answering = _ReplaceableService(handler)
            answering.service = advertise(name, srv_class, lambda request: answering.handler(request))
            return answering

        answering = self._opening(("service", advertise.__name__, name, srv_class), make)
        answering.handler = handler
        return answering


class _ReplaceableService:
    """A service whose handler can be replaced."""

    def __init__(self, handler: Callable[[Any], Any]) -> None:
        self.handler = handler
        self.service: Service

    def close(self) -> None:
        self.service.close()


def _close_all(opened: list[_Opened]) -> None:
    for _, thing, closes in reversed(opened):
        if closes:
            thing.close()
