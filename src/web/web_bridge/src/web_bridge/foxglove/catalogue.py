# SPDX-License-Identifier: BSD-3-Clause
"""The topics and services of the graph as channels with numbers, and what has changed since the last look."""
from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from web_bridge.errors import BridgeError

if TYPE_CHECKING:
    from web_bridge.foxglove.rules import FoxgloveRules

_ENCODING, _SCHEMA_ENCODING = "ros1", "ros1msg"


class GraphState(NamedTuple):
    """The master's state: {name: nodes} three times, and {topic: type} of topics that somebody publishes."""

    published: dict
    subscribed: dict
    services: dict
    types: dict


NOTHING = GraphState({}, {}, {}, {})


class Channel(NamedTuple):
    """A topic that can be subscribed to. ``schema``: the definition of its type with all that it holds."""

    id: int
    topic: str
    type: str
    schema: str
    md5: str

    def advertised(self) -> dict[str, Any]:
        return {"id": self.id, "topic": self.topic, "encoding": _ENCODING, "schemaName": self.type,
                "schema": self.schema, "schemaEncoding": _SCHEMA_ENCODING}


class ServiceEntry(NamedTuple):
    """A service that can be called; ``request`` and ``response``: definitions."""

    id: int
    name: str
    type: str
    request: str
    response: str
    providers: frozenset = frozenset()

    def advertised(self) -> dict[str, Any]:
        # requestSchema and responseSchema: what clients before 2024 read.
        return {"id": self.id, "name": self.name, "type": self.type, "requestSchema": self.request,
                "responseSchema": self.response, "request": self._part("Request", self.request),
                "response": self._part("Response", self.response)}

    def _part(self, name: str, schema: str) -> dict[str, str]:
        return {"encoding": _ENCODING, "schemaName": self.type + name, "schemaEncoding": _SCHEMA_ENCODING,
                "schema": schema}


class CatalogueChanges(NamedTuple):
    """Messages to clients after a look at the graph. ``graph``: the fields of connectionGraphUpdate."""

    channels: tuple = ()
    gone_channels: tuple = ()
    services: tuple = ()
    gone_services: tuple = ()
    graph: dict = {}  # never changed
    problems: tuple = ()

    def __bool__(self) -> bool:
        return bool(self.channels or self.gone_channels or self.services or self.gone_services
                    or is_different(self.graph))


class Catalogue:
    """``message_schema(topic, type)`` -> (definition, MD5) and ``service_schema(name)`` -> (type, request, response)
    may ask other nodes and raise BridgeError: such a topic or service is left out, and tried again at the next look.
    One thread looks; others read :attr:`channels` and :attr:`services`.
    """

    def __init__(self, rules: FoxgloveRules, message_schema: Callable[[str, str], tuple[str, str]],
                 service_schema: Callable[[str], tuple[str, str, str]]) -> None:
        self._rules = rules
        self._message_schema = message_schema
        self._service_schema = service_schema
        self._channel_ids, self._service_ids = itertools.count(1), itertools.count(1)
        self._of_topic, self._of_service = {}, {}
        #: By their ids; replaced as a whole.
        self.channels, self.services = {}, {}
        self.state = NOTHING

    def look(self, state: GraphState) -> CatalogueChanges:
        """Compare with a GraphState; returns CatalogueChanges."""
        problems = []
        channels = self._updated_channels(state, problems)
        services = self._updated_services(state, problems)
        gone_channels = tuple(sorted(set(self.channels) - set(channels)))
        new_channels = tuple(channels[one] for one in sorted(set(channels) - set(self.channels)))
        gone_services = tuple(sorted(set(self.services) - set(services)))
        new_services = tuple(services[one] for one in sorted(set(services) - set(self.services)))
        graph = graph_update(self.state, state)
        self.channels, self.services, self.state = channels, services, state
        return CatalogueChanges(new_channels, gone_channels, new_services, gone_services, graph, tuple(problems))

    def forget_service(self, entry: ServiceEntry) -> None:
        """Ask again for the type of a service at the next look."""
        self._of_service.pop(entry.name, None)

    def _updated_channels(self, state: GraphState, problems: list[Any]) -> dict[int, Channel]:
        known, self._of_topic = self._of_topic, {}
        for topic, type_name in sorted(state.types.items()):
            if topic not in state.published or not self._rules.shows_topic(topic):
                continue
            channel = known.get(topic)
            if channel is None or channel.type != type_name:
                try:
                    schema, md5 = self._message_schema(topic, type_name)
                except BridgeError as error:
                    problems.append("%s is not offered: %s" % (topic, error))
                    continue
                channel = Channel(next(self._channel_ids), topic, type_name, schema, md5)
            self._of_topic[topic] = channel
        return {channel.id: channel for channel in self._of_topic.values()}

    def _updated_services(self, state: GraphState, problems: list[str]) -> dict[int, ServiceEntry]:
        known, self._of_service = self._of_service, {}
        for name, nodes in sorted(state.services.items()):
            if not self._rules.shows_service(name):
                continue
            entry = known.get(name)
            if entry is None or entry.providers != frozenset(nodes):
                try:
                    parts = self._service_schema(name)
                except BridgeError as error:
                    problems.append("the service %s is not offered: %s" % (name, error))
                    continue
                entry = ServiceEntry(next(self._service_ids), name, *parts, frozenset(nodes))
            self._of_service[name] = entry
        return {entry.id: entry for entry in self._of_service.values()}


def graph_update(before: GraphState, after: GraphState) -> dict[str, list[Any]]:
    """The fields of a connectionGraphUpdate from one GraphState to another."""
    published = _changed(before.published, after.published)
    subscribed = _changed(before.subscribed, after.subscribed)
    services = _changed(before.services, after.services)
    topics = set(after.published) | set(after.subscribed)
    gone_topics = sorted((set(before.published) | set(before.subscribed)) - topics)
    gone_services = sorted(set(before.services) - set(after.services))
    # A topic that lost its last publisher and still has subscribers is there, without publishers.
    published.update({name: () for name in set(before.published) - set(after.published) if name in topics})
    subscribed.update({name: () for name in set(before.subscribed) - set(after.subscribed) if name in topics})
    return {"publishedTopics": _listed(published, "publisherIds"),
            "subscribedTopics": _listed(subscribed, "subscriberIds"),
            "advertisedServices": _listed(services, "providerIds"),
            "removedTopics": gone_topics, "removedServices": gone_services}


def is_different(update: dict[str, list[Any]]) -> bool:
    """Does a connectionGraphUpdate say anything?"""
    return any(update.values())


def _changed(before: dict[str, list[str]], after: dict[str, list[str]]) -> dict[str, list[str]]:
    return {name: nodes for name, nodes in after.items() if set(before.get(name, ())) != set(nodes)
            or name not in before}


def _listed(nodes_of: Mapping[str, Sequence[str]], key: str) -> list[dict[str, Any]]:
    return [{"name": name, key: sorted(nodes)} for name, nodes in sorted(nodes_of.items())]
