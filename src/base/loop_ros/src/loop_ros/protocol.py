# SPDX-License-Identifier: BSD-3-Clause
"""The ROS interface of code that runs in the loop.

:class:`Topics` and :class:`Log` are for controllers, action servers and settings; plugins get a
:class:`loop_ros.node_handle.NodeHandle`, which uses a :class:`LoopRos`. The simulator's implementation is
``loop_ros.ros_objects.RosObjects``; tests use ``loop_ros.testing.FakeRos``. Nothing here waits.
"""
from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol


class Publisher(Protocol):
    """One topic that is published."""

    #: Its absolute name.
    topic: str
    #: Function without arguments -> messages, or None. While the world is paused, when nothing else is published, who
    #: connects gets these: the state that the world is in.
    present: Callable[[], Sequence[Any]] | None

    @property
    def has_listeners(self) -> bool:
        """Whether a subscriber is connected. Callers check it before they make a message."""
        ...

    def publish(self, message: Any) -> None:
        """Send ``message`` to all subscribers. Raises ``genpy.SerializationError`` if it cannot be serialized."""

    def renew(self) -> None:
        """The state that ``present`` tells is another one: in a paused world, everybody gets it."""

    def close(self) -> None:
        """Stop publishing."""


class Subscription(Protocol):
    """One topic that is subscribed to. It keeps up to ``depth`` unread messages for the loop."""

    #: How many publishers are connected: a function without arguments.
    senders: Callable[[], int]

    def take(self) -> Any:
        """The newest unread message, or None; older ones are dropped."""
        ...

    def drain(self) -> list[Any]:
        """All unread messages, oldest first: a list."""
        ...

    def handle(self, handler: Callable[[Any], Any]) -> None:
        """Call ``handler(message)`` for each unread message, oldest first; if it raises, the message is dropped and the
        error is counted."""

    def guarded(self, handler: Callable[..., Any], *arguments: Any) -> None:
        """Call ``handler(*arguments)``; an error is counted as the fault of a message."""

    def close(self) -> None:
        """Unsubscribe and drop the unread messages."""


class Service(Protocol):
    """A service that is served."""

    def close(self) -> None:
        """No longer serve it. Closing it twice does no harm."""


class Log(Protocol):
    """Lines of the log. The throttled ones come at most once in ``period_s`` wall seconds from a place in the code."""

    def info(self, text: str) -> None:
        """A line at level info."""

    def warn(self, text: str) -> None:
        """A line at level warning."""

    def error(self, text: str) -> None:
        """A line at level error."""

    def info_throttle(self, period_s: float, text: str) -> None:
        """As ``info``."""

    def warn_throttle(self, period_s: float, text: str) -> None:
        """As ``warn``."""

    def error_throttle(self, period_s: float, text: str) -> None:
        """As ``error``."""


class Topics(Protocol):
    """Makes the publishers, subscriptions and services of one owner. Names are absolute or relative to the owner's
    namespace."""

    def publisher(self, topic: str, msg_class: type, latch: bool = False) -> Publisher:
        """Publish ``topic``; ``latch``: a late subscriber gets the last message."""
        ...

    def subscription(self, topic: str, msg_class: type, depth: int = 1) -> Subscription:
        """Subscribe to ``topic``; ``depth``: how many unread messages are kept, the newest ones, at least 1."""
        ...

    def service(self, name: str, srv_class: type, handler: Callable[[Any], Any]) -> Service:
        """Serve ``name``; ``handler(request)`` runs in the loop between two ticks and returns the response."""
        ...

    def close(self) -> None:
        """Close all of them."""


class FaultCounter(Protocol):
    """Errors that the loop survives, counted by place."""

    def note(self, place: str, error: BaseException, consequence: str = "") -> None:
        """Count ``error`` at ``place``: a topic, a service, a part of the loop."""


class LoopRos(Protocol):
    """Makes publishers, subscriptions and services from absolute names; for a name that is none in ROS, each raises
    ``loop_ros.names.IllegalName``."""

    @property
    def faults(self) -> FaultCounter:
        """Errors that the loop survives."""
        ...

    def publisher(self, topic: str, msg_class: type, latch: bool = False, greet: bool = False) -> Publisher:
        """Publish ``topic``; ``latch``: a late subscriber gets the last message; ``greet``: the same, but without the
        latched flag."""
        ...

    def subscription(self, topic: str, msg_class: type, depth: int = 1,
                     notice: Callable[[], object] = lambda: None) -> Subscription:
        """As :meth:`Topics.subscription`; ``notice()`` is called after each message, in any thread."""
        ...

    def service(self, name: str, srv_class: type, handler: Callable[[Any], Any]) -> Service:
        """As :meth:`Topics.service`."""
        ...

    def service_in_thread(self, name: str, srv_class: type, handler: Callable[[Any], Any]) -> Service:
        """Serve ``name``; ``handler(request)`` runs in a separate thread."""
        ...

    def served(self) -> list[str]:
        """Names of the services that are served now: a list."""
        ...

    def subscribed(self) -> list[str]:
        """Names of the topics that are subscribed to now: a list."""
        ...

    def withdraw(self, name: str) -> Callable[[Any], Any] | None:
        """Close all owners' service and subscriptions of this name; returns the service's handler, or None where there
        is no such service."""
        ...

    def call_in_loop(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """Any thread but the loop's: call ``function(*arguments)`` in the loop between two ticks; return its result or
        raise its error."""
        ...

    def deliveries(self) -> dict[str, int]:
        """How many messages the subscriptions have received: {topic: count}."""
        ...

    def reads(self) -> int:
        """How often the loop has read what has come for its subscriptions. Between two ticks with the same number, no
        message could arrive."""
        ...

    def flush(self, timeout_s: float = 10.0) -> bool:
        """Any thread but the loop's: wait until everything that was opened is registered; returns whether it is."""
        ...
