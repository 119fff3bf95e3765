# SPDX-License-Identifier: BSD-3-Clause
"""The node rosapi: services /rosapi/…."""
from __future__ import annotations

import json
import re
import threading
from collections.abc import Callable
from typing import Any
from urllib.parse import urlsplit

import rosgraph
import rospy
import rosservice

from rosapi import msg, queries, srv  # pyright: ignore[reportAttributeAccessIssue]  (generated: msg, srv)
from rosapi.typedefs import definitions
from rospy_nodes.start import end_on_signals, limit_ports
from web_bridge.access import is_token, patterns_of, without_tokens
from web_bridge.errors import BridgeError
from web_bridge.ros_graph import message_class, service_class


def published_name(type_name: str) -> str:
    """The service's name by its type's: GetParamNames -> get_param_names."""
    name = re.sub(r"(?<!^)(?=[A-Z])", "_", type_name).lower()
    return "action_servers" if name == "get_action_servers" else name


class RosApi:
    """One method for each service; the services' types have their names."""

    def __init__(self) -> None:
        self._master = rosgraph.Master(rospy.get_name())
        self._lock = threading.Lock()  # xmlrpc's proxies serve one thread
        self._topics, self._services, self._params = (
            patterns_of(str(rospy.get_param("~%s_glob" % kind, "[*]"))) for kind in ("topics", "services", "params"))
        self._kept = [
            rospy.Service("~" + published_name(name), getattr(srv, name), self._guarded(name)) for name in names()]

    def _guarded(self, name: str) -> Callable[[Any], Any]:
        answer = getattr(self, published_name(name))

        def handler(request: Any) -> Any:
            try:
                return answer(request)
            except (BridgeError, rosgraph.MasterException, rosservice.ROSServiceException, OSError) as error:
                raise rospy.ServiceException(str(error)) from None
        return handler

    def _ask(self, method: str, *arguments: Any) -> Any:
        with self._lock:
            return getattr(self._master, method)(*arguments)

    def _state(self) -> Any:
        return self._ask("getSystemState")

    def _topic_types(self) -> dict[str, str]:
        types = self._ask("getTopicTypes")
        return {name: kind for name, kind in types if queries.is_allowed(name, self._topics)}

    def _type_of_service(self, name: str) -> str:
        """"" where it cannot be asked: its node may be gone."""
        try:
            return rosservice.get_service_type(name) or ""
        except (rosservice.ROSServiceException, OSError):
            return ""

    # Topics

    def topics(self, _request: object) -> list[Any]:
        """Topics with their types; "" for one that nobody typed."""
        types = self._topic_types()
        found = queries.allowed(queries.topics(self._state()), self._topics)
        return [found, [types.get(name, "") for name in found]]

    def topics_for_type(self, request: Any) -> list[Any]:
        return [sorted(name for name, kind in self._topic_types().items() if kind == request.type)]

    def topics_and_raw_types(self, request: Any) -> list[Any]:
        found, types = self.topics(request)
        return [found, types, [_full_text(kind) for kind in types]]

    def topic_type(self, request: Any) -> str:
        return self._topic_types().get(rospy.resolve_name(request.topic), "")

    def publishers(self, request: Any) -> list[Any]:
        topic = rospy.resolve_name(request.topic)
        return [queries.publishers(self._state(), topic) if queries.is_allowed(topic, self._topics) else []]

    def subscribers(self, request: Any) -> list[Any]:
        topic = rospy.resolve_name(request.topic)
        return [queries.subscribers(self._state(), topic) if queries.is_allowed(topic, self._topics) else []]

    def action_servers(self, _request: object) -> list[Any]:
        return [queries.action_servers(queries.allowed(queries.topics(self._state()), self._topics))]

    # Services

    def services(self, _request: object) -> list[Any]:
        return [queries.allowed(queries.services(self._state()), self._services)]

    def services_for_type(self, request: Any) -> list[Any]:
        found = queries.allowed(queries.services(self._state()), self._services)
        return [[name for name in found if self._type_of_service(name) == request.type]]

    def service_type(self, request: Any) -> str:
        name = rospy.resolve_name(request.service)
        return self._type_of_service(name) if queries.is_allowed(name, self._services) else ""

    def service_node(self, request: Any) -> str:
        return next(iter(queries.providers(self._state(), rospy.resolve_name(request.service))), "")

    def service_host(self, request: Any) -> str:
        uri = rosservice.get_service_uri(rospy.resolve_name(request.service))
        return (urlsplit(str(uri)).hostname or "") if uri else ""

    def service_providers(self, request: Any) -> list[Any]:
        """The nodes of a service; a type asks for the nodes of all services of it, as 0.11.17 has it."""
        state = self._state()
        found = queries.providers(state, rospy.resolve_name(request.service))
        if not found and "/" in request.service.strip("/"):
            names_of_type = [name for name in queries.services(state) if self._type_of_service(name) == request.service]
            found = sorted({node for name in names_of_type for node in queries.providers(state, name)})
        return [found]

    def service_request_details(self, request: Any) -> list[Any]:
        return [_type_defs(service_class(request.type)._request_class)]

    def service_response_details(self, request: Any) -> list[Any]:
        return [_type_defs(service_class(request.type)._response_class)]

    def message_details(self, request: Any) -> list[Any]:
        return [_type_defs(message_class(request.type))]

    # Nodes

    def nodes(self, _request: object) -> list[Any]:
        return [queries.nodes(self._state())]

    def node_details(self, request: Any) -> list[Any]:
        return list(queries.of_node(self._state(), rospy.resolve_name(request.node)))

    # Parameters

    def get_param(self, request: Any) -> str:
        """The value as a JSON text; null where there is none, and no default."""
        value = _from_json(request.default) if request.default else None
        if self._is_shown(request.name):
            try:
                # Not rospy's, which answers "/" from its cache, with a part of the parameters.
                value = without_tokens(self._ask("getParam", rospy.resolve_name(request.name)))
            except rosgraph.MasterError:
                pass  # not set
        return json.dumps(queries.finite(value), default=str)

    def set_param(self, request: Any) -> list[Any]:
        """A value that is no JSON text is a text itself."""
        self._check_param(request.name)
        rospy.set_param(request.name, _from_json(request.value))
        return []

    def delete_param(self, request: Any) -> list[Any]:
        self._check_param(request.name)
        if rospy.has_param(request.name):
            rospy.delete_param(request.name)
        return []

    def has_param(self, request: Any) -> bool:
        return self._is_shown(request.name) and rospy.has_param(request.name)

    def search_param(self, request: Any) -> str:
        found = str(rospy.search_param(request.name) or "")
        return found if found and self._is_shown(found) else ""

    def get_param_names(self, _request: object) -> list[Any]:
        return [queries.allowed((name for name in self._ask("getParamNames") if not is_token(name)), self._params)]

    def get_time(self, _request: object) -> rospy.Time:
        return rospy.Time.now()

    def _is_shown(self, name: str) -> bool:
        name = rospy.resolve_name(name)
        return queries.is_allowed(name, self._params) and not is_token(name)

    def _check_param(self, name: str) -> None:
        if rospy.resolve_name(name) == "/":
            raise BridgeError("%r is a namespace: it would change all parameters at once" % name)
        if not queries.is_allowed(rospy.resolve_name(name), self._params):
            raise BridgeError("params_glob of this server does not allow the parameter %s" % name)


def names() -> list[str]:
    """The names of the service types: the published ones, and none of the helpers that srv has beside them."""
    return sorted(name for name in vars(srv) if hasattr(getattr(srv, name), "_request_class"))


def _from_json(text: str) -> Any:
    try:
        return json.loads(text)
    except ValueError:
        return text


def _type_defs(cls: type) -> list[msg.TypeDef]:
    return [msg.TypeDef(*definition) for definition in definitions(cls, message_class)]


def _full_text(type_name: str) -> str:
    try:
        return message_class(type_name)._full_text
    except BridgeError:
        return ""


def main() -> None:
    limit_ports()
    end_on_signals()
    rospy.init_node("rosapi", disable_signals=True)
    api = RosApi()
    rospy.loginfo("rosapi serves the questions of web clients")
    rospy.spin()
    del api
