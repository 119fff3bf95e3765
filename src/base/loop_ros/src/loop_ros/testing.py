# SPDX-License-Identifier: BSD-3-Clause
"""ROS for tests, without a master: publishers keep their messages, and tests put messages into subscriptions.

``test_fake_ros.py`` runs the same cases against this and the simulator's own code. Subscriptions, faults and the
answers of services are the real code.
"""
from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from typing import Any

from loop_ros.faults import Faults
from loop_ros.names import checked_name
from loop_ros.ros_objects import answering
from loop_ros.subscription import MessageQueue


class FakeLog:
    """``lines``: the texts of all levels, in their order. The throttled variants keep every line."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self._levels: list[str] = []

    def info(self, text: str) -> None:
        self._take("info", text)

    def warn(self, text: str) -> None:
        self._take("warn", text)

    def error(self, text: str) -> None:
        self._take("error", text)

    def info_throttle(self, period_s: float, text: str) -> None:
        self._take("info", text)

    def warn_throttle(self, period_s: float, text: str) -> None:
        self._take("warn", text)

    def error_throttle(self, period_s: float, text: str) -> None:
        self._take("error", text)

    def of(self, level: str) -> list[str]:
        """The texts of one level."""
        return [text for found, text in zip(self._levels, self.lines, strict=True) if found == level]

    def _take(self, level: str, text: str) -> None:
        self.lines.append(text)
        self._levels.append(level)


class FakeFaults(Faults):
    """``noted``: list of (place, error)."""

    def __init__(self) -> None:
        super().__init__(FakeLog())
        self.noted: list[tuple[str, BaseException]] = []

    def note(self, place: str, error: BaseException, consequence: str = "it is left out") -> None:
        self.noted.append((place, error))
        super().note(place, error, consequence)


class FakeRos:
    """A ``loop_ros.protocol.LoopRos`` that keeps what is open now, by absolute name; also a ``Topics``.

    ``publishers``: {topic: the first open :class:`FakePublisher`}; ``subscriptions``: {topic: :class:`FakeTopic`};
    ``services``: {name: function that takes a request and returns or raises what a client would get}; ``faults``:
    :class:`FakeFaults`.
    """

    def __init__(self, heard: Callable[[str], bool] = lambda topic: True,
                 clock: Callable[[], float] = lambda: 0.0) -> None:
        """``heard(topic)``: whether the topic has a subscriber from the start; ``clock()``: see
        :attr:`FakePublisher.timed`."""
        self.publishers: dict[str, FakePublisher] = {}
        self.subscriptions: dict[str, FakeTopic] = {}
        self.services: dict[str, Callable[[Any], Any]] = {}
        self.faults = FakeFaults()
        self._heard, self._clock = heard, clock
        self._handlers: dict[str, tuple[_FakeService, Callable[[Any], Any]]] = {}
        self._delivered_before: dict[str, int] = {}
        self._reads = 0

    def publisher(self, topic: str, msg_class: type, latch: bool = False, greet: bool = False) -> FakePublisher:
        _check(topic)
        first = self.publishers.get(topic)
        sent = _Sent(self._heard(topic), self._clock) if first is None else first._sent
        return FakePublisher(sent, msg_class, latch or greet, self.publishers, topic)

    def subscription(self, topic: str, msg_class: type, depth: int = 1,
                     notice: Callable[[], object] = lambda: None) -> MessageQueue:
        _check(topic)
        subscription = MessageQueue(depth, notice, self._counting(topic))
        subscribed = self.subscriptions.setdefault(topic, FakeTopic(msg_class))
        subscribed.all.append(subscription)

        def leave() -> None:
            if subscription in subscribed.all:
                self._delivered_before[topic] = self._delivered_before.get(topic, 0) + subscription.delivered
                subscribed.all.remove(subscription)
            if not subscribed.all:
                self.subscriptions.pop(topic, None)

        subscription.on_close = leave
        return subscription

    def service(self, name: str, srv_class: type, handler: Callable[[Any], Any]) -> _FakeService:
        _check(name)
        service = _FakeService(self, name)
        self._handlers[name] = service, handler
        self.services[name] = answering(name, handler, self.faults)
        return service

    def service_in_thread(self, name: str, srv_class: type, handler: Callable[[Any], Any]) -> _FakeService:
        return self.service(name, srv_class, handler)

    def served(self) -> list[str]:
        return list(self.services)

    def subscribed(self) -> list[str]:
        return list(self.subscriptions)

    def withdraw(self, name: str) -> Callable[[Any], Any] | None:
        if name in self.subscriptions:
            self.subscriptions[name].close()
        service, handler = self._handlers.get(name, (None, None))
        if service is not None:
            service.close()
        return handler

    def call_in_loop(self, function: Callable[..., Any], *arguments: Any) -> Any:
        return function(*arguments)

    def deliveries(self) -> dict[str, int]:
        return {topic: self._delivered_before.get(topic, 0) + sum(one.delivered for one in subscribed.all)
                for topic, subscribed in self.subscriptions.items()}

    def reads(self) -> int:
        # Messages arrive at any time.
        self._reads += 1
        return self._reads

    def flush(self, timeout_s: float = 10.0) -> bool:
        return True

    def close(self) -> None:
        for opened in [*self.publishers.values(), *self.subscriptions.values()]:
            opened.close()
        for service, _ in list(self._handlers.values()):
            service.close()

    def _counting(self, topic: str) -> Callable[[BaseException], None]:
        return lambda error: self.faults.note(topic, error, "the message is dropped")


def _check(name: str) -> None:
    """Tests may leave out the leading slash."""
    checked_name(name if name.startswith("/") else "/" + name)


class _Sent:
    """The messages of all publishers of a topic while it had a subscriber."""

    def __init__(self, heard: bool, clock: Callable[[], float]) -> None:
        self.heard, self.clock = heard, clock
        self.messages: list[Any] = []
        self.times: list[float] = []
        self.last: Any = None

    def send(self, message: Any) -> None:
        self.messages.append(message)
        self.times.append(self.clock())


class FakePublisher:
    """``messages``: the messages that a subscriber received, each deserialized from its bytes; one that cannot be
    serialized raises.

    ``has_listeners`` may be set. Several publishers of a topic share both. ``keeps_last``: whether a late subscriber
    gets the last message. ``renewed``: how often :meth:`renew` was called; there is no pause here.
    """

    def __init__(self, sent: _Sent, msg_class: type, keeps_last: bool, publishers: dict[str, FakePublisher],
                 topic: str) -> None:
        self.topic, self.msg_class, self.is_closed = topic, msg_class, False
        self.present: Callable[[], Sequence[Any]] | None = None
        self.renewed = 0
        self.keeps_last = keeps_last
        self._sent = sent
        self._publishers = publishers
        self._seq = 0
        publishers.setdefault(topic, self)

    @property
    def messages(self) -> list[Any]:
        return self._sent.messages

    @property
    def timed(self) -> list[tuple[float, Any]]:
        """[(the clock's time, message)]"""
        return list(zip(self._sent.times, self._sent.messages, strict=True))

    @property
    def has_listeners(self) -> bool:
        return self._sent.heard and not self.is_closed

    @has_listeners.setter
    def has_listeners(self, heard: bool) -> None:
        late = heard and not self._sent.heard
        self._sent.heard = heard
        if late and self._sent.last is not None:
            self._sent.send(self._sent.last)

    def renew(self) -> None:
        self.renewed += 1

    def publish(self, message: Any) -> None:
        if self.is_closed or not (self.keeps_last or self._sent.heard):
            return
        if getattr(message, "_has_header", False):
            self._seq += 1
            message.header.seq = self._seq
        buffer = io.BytesIO()
        message.serialize(buffer)
        received = self.msg_class().deserialize(buffer.getvalue())
        if self._sent.heard:
            self._sent.send(received)
        if self.keeps_last:
            self._sent.last = received

    def close(self) -> None:
        self.is_closed = True
        if self._publishers.get(self.topic) is self:
            del self._publishers[self.topic]


class FakeTopic:
    """All subscriptions to one topic: ``put`` a message into each of them."""

    def __init__(self, msg_class: type) -> None:
        self.msg_class = msg_class
        self.all: list[MessageQueue] = []

    def put(self, message: Any) -> None:
        for subscription in list(self.all):
            subscription.put(message)

    def close(self) -> None:
        for subscription in list(self.all):
            subscription.close()


class _FakeService:
    def __init__(self, ros: FakeRos, name: str) -> None:
        self._ros, self._name = ros, name

    def close(self) -> None:
        service, _ = self._ros._handlers.get(self._name, (None, None))
        if service is self:
            del self._ros._handlers[self._name], self._ros.services[self._name]
