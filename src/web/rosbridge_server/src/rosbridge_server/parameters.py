# SPDX-License-Identifier: BSD-3-Clause
"""The parameters of rosbridge_websocket, by their published names. No ROS."""
from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from web_bridge.access import Rules, patterns_of
from web_bridge.parameters import Endpoint, ParameterError, access_of, number, port_of, switch, tls_of, warnings_of
from web_bridge.session import BridgeOptions
from web_bridge.websocket import SocketOptions


class RosbridgeParameters(NamedTuple):
    """Parameters of the node; ``warnings`` for its log."""

    endpoint: Endpoint
    bridge: BridgeOptions
    socket: SocketOptions
    warnings: tuple


def read_parameters(get: Callable[[str, Any], Any]) -> RosbridgeParameters:
    """``get(name, default)`` returns a parameter of the node. Raises ParameterError."""
    address, access = str(get("address", "localhost")), access_of(get)
    _refuse_what_is_not_served(get)
    rules = Rules(patterns_of(str(get("topics_glob", "[*]"))), patterns_of(str(get("services_glob", "[*]"))))
    socket = SocketOptions(
        access, rules, number(get, "delay_between_messages", 0.0), switch(get, "use_compression", False),
        number(get, "websocket_ping_interval", 0.0), number(get, "websocket_ping_timeout", 30.0),
        int(number(get, "max_message_size", SocketOptions._field_defaults["largest_message"])))
    bridge = BridgeOptions(number(get, "unregister_timeout", 10.0), number(get, "fragment_timeout", 600.0))
    endpoint = Endpoint(port_of(get, 9090), address, tls_of(get, "ssl"),
                        max(0.1, number(get, "retry_startup_delay", 5.0)))
    return RosbridgeParameters(endpoint, bridge, socket, warnings_of(address, access))


def _refuse_what_is_not_served(get: Callable[[str, Any], Any]) -> None:
    if switch(get, "authenticate", False):
        raise ParameterError("~authenticate asks for rosauth, which this server does not use; set ~token, and let "
                             "clients connect to ws://host:port/?token=…")
    if switch(get, "bson_only_mode", False) or get("binary_encoder", "default") == "bson":
        raise ParameterError("BSON is not served; JSON and CBOR are, without a setting")
