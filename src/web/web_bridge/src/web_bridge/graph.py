# SPDX-License-Identifier: BSD-3-Clause
"""Topics and services as the clients' sessions see them. No ROS; :mod:`web_bridge.ros_graph` has them in rospy."""
from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from genpy import Message

    from web_bridge.feeds import Arrival
    from web_bridge.foxglove.catalogue import GraphState
    from web_bridge.services import Call


class Closable(Protocol):
    """A service that is offered, for instance."""

    def close(self) -> None: ...


class SubscribedTopic(Closable, Protocol):
    """A subscribed topic."""

    def publishers(self) -> set[str]:
        """Names of the publishers that are connected."""
        ...


class AdvertisedTopic(Closable, Protocol):
    """An advertised topic."""

    type: str
    new_message: Callable[[], Message]

    def publish(self, message: Message) -> None: ...


class Graph(Protocol):
    """Topics and services. Every method may block on the master and raise BridgeError."""

    def resolve(self, name: str) -> str:
        """The absolute name of a topic or service."""
        ...

    def topic_type(self, topic: str) -> str | None:
        """The established type."""
        ...

    def published_topics(self) -> dict[str, str]:
        """The topics that have a publisher, {name: type}."""
        ...

    def check_type(self, topic: str, type_name: str | None) -> None:
        """Raise if the type is unknown here or is not the topic's."""
        ...

    def subscribe(self, topic: str, arrived: Callable[[Arrival], None]) -> SubscribedTopic:
        """``arrived`` is called on any thread."""
        ...

    def advertise(self, topic: str, type_name: str, latched: bool, queue_size: int) -> AdvertisedTopic: ...

    def call_service(self, service: str, fill: Callable[[Message], Message], call: Call) -> Message:
        """The response. ``fill`` lays the arguments over an empty request; ``call`` gets the way to end the wait."""
        ...

    def advertise_service(self, service: str, type_name: str,
                          handler: Callable[[Message, Callable[[], Message]], Message]) -> Closable:
        """``handler(request, new_response)`` returns the response or raises ServiceFailed."""
        ...


class WatchedGraph(Graph, Protocol):
    """The same with the master's state and parameters, for Foxglove."""

    def state(self) -> GraphState: ...

    def message_schema(self, topic: str, type_name: str) -> tuple[str, str]:
        """(definition with the definitions of all nested types, MD5)."""
        ...

    def service_schema(self, service: str) -> tuple[str, str, str]:
        """(type, definition of the request, of the response)."""
        ...

    def parameters(self) -> dict[str, Any]:
        """The master's tree."""
        ...

    def set_parameter(self, name: str, value: Any) -> None: ...

    def delete_parameter(self, name: str) -> None: ...

    def on_parameter(self, changed: Callable[[str, Any], None]) -> None:
        """``changed(name, value)`` is called on any thread, with ``{}`` for a deleted parameter."""
        ...

    def watch_parameter(self, name: str) -> None:
        """Notify of changes of this parameter from now on."""
        ...

    def package_folder(self, name: str) -> str | None: ...
