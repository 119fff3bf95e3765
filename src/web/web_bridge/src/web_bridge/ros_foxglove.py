# SPDX-License-Identifier: BSD-3-Clause
"""The graph of :mod:`web_bridge.foxglove.bridge` in rospy."""
from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable
from typing import Any
from xmlrpc.client import Error

import rosgraph.network
import rospkg
import rospy
from rospy.impl.paramserver import get_param_server_cache

import master_calls
from web_bridge.errors import BridgeError, ServiceFailed, UnknownType
from web_bridge.foxglove.catalogue import GraphState
from web_bridge.ros_graph import PROBE, RosGraph, address_of, handshake, message_class, service_class

#: Connecting to a publisher for its definition [s].
_PROBE_S = 2.0
#: Packages are looked for again, where one is missing, at most that often [s].
_CRAWL_EVERY_S = 5.0


def options_of_graph() -> tuple[str, dict[str, str], bool]:
    """(session id, metadata, is time simulated?) of the master, for FoxgloveOptions."""
    return (str(rospy.get_param("/run_id", "")), {"ROS_DISTRO": str(rospy.get_param("/rosdistro", "")).strip()},
            bool(rospy.get_param("/use_sim_time", False)))


class FoxgloveGraph(RosGraph):
    """Beside topics and services: the master's state, definitions, parameters, packages.

    ``probe_s``: how long a service may take to tell its type [s].
    """

    def __init__(self, probe_s: float = 0.25) -> None:
        super().__init__()
        self._probe_s = probe_s
        self._packages = PackageFolders()

    def state(self) -> GraphState:
        published, subscribed, services = self._ask("getSystemState")
        types = {topic: kind for topic, kind in self._ask("getTopicTypes") if kind != "*"}
        return GraphState(dict(published), dict(subscribed), dict(services), types)

    def message_schema(self, topic: str, type_name: str) -> tuple[str, str]:
        try:
            cls = message_class(type_name)
            return cls._full_text, cls._md5sum
        except UnknownType as error:
            # A type that this machine does not have is known to its publishers.
            return self._definition_of_publisher(topic, type_name, error)

    def service_schema(self, service: str) -> tuple[str, str, str]:
        type_name = self._type_of_service(service)
        cls = service_class(type_name)
        return type_name, cls._request_class._full_text, cls._response_class._full_text

    def parameters(self) -> dict[str, Any]:
        return self._ask("getParam", "/")

    def set_parameter(self, name: str, value: Any) -> None:
        try:
            self._ask("setParam", name, value)
        except (OverflowError, TypeError, ValueError) as error:
            raise BridgeError("parameter %s: the master cannot hold this value: %s" % (name, error)) from None

    def delete_parameter(self, name: str) -> None:
        self._ask("deleteParam", name)

    def on_parameter(self, changed: Callable[[str, Any], None]) -> None:
        get_param_server_cache().set_notifier(changed)

    def watch_parameter(self, name: str) -> None:
        try:
            # Makes rospy subscribe to it at the master, also where it is not set.
            rospy.get_param_cached(name, None)
        except (OSError, Error, rospy.ROSException) as error:
            raise BridgeError("parameter %s: %s" % (name, error)) from None

    def package_folder(self, name: str) -> str | None:
        return self._packages.folder(name)

    def _type_of_service(self, service: str) -> str:
        address = address_of(self._ask("lookupService", service))
        type_name = _header(address, {**PROBE, "service": service}, self._probe_s).get("type")
        if not type_name:
            raise ServiceFailed("it does not tell its type")
        return type_name

    def _definition_of_publisher(self, topic: str, type_name: str, error: Exception) -> tuple[str, str]:
        request = {"topic": topic, "type": "*", "md5sum": "*"}
        for node in dict(self._ask("getSystemState")[0]).get(topic, ()):
            try:
                with master_calls.proxy(self._ask("lookupNode", node), _PROBE_S) as proxy:
                    _, host, port = master_calls.value(proxy.requestTopic(rospy.get_name(), topic, [["TCPROS"]]))
                header = _header((host, port), request, _PROBE_S)
            except (*master_calls.NO_ANSWER, BridgeError, TypeError):
                continue
            if header.get("type") == type_name and header.get("message_definition"):
                return header["message_definition"], header.get("md5sum", "*")
        raise error


def _header(address: tuple[str, int], request: dict[str, str], timeout_s: float) -> dict[str, str]:
    """The answer to a header of TCPROS. Raises BridgeError."""
    try:
        return handshake(address, request, timeout_s)
    except (OSError, rosgraph.network.ROSHandshakeException) as error:
        raise BridgeError("%s:%s does not answer: %s" % (*address, error)) from None


class PackageFolders:
    """Folders of packages; looks again for one that is missing, not too often."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._found = None
        self._looked = 0.0

    def folder(self, name: str) -> str | None:
        with self._lock:
            if self._found is None or (name not in self._found.list()
                                       and time.monotonic() - self._looked > _CRAWL_EVERY_S):
                self._found, self._looked = rospkg.RosPack(), time.monotonic()
            try:
                return os.fspath(self._found.get_path(name))
            except rospkg.ResourceNotFound:
                return None
