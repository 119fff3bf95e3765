# SPDX-License-Identifier: BSD-3-Clause
"""The parameters of foxglove_bridge, by their published names. No ROS."""
from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from web_bridge.foxglove.rules import ASSETS, CAPABILITIES, FoxgloveRules, compiled
from web_bridge.parameters import Endpoint, ParameterError, access_of, number, port_of, switch, tls_of, warnings_of
from web_bridge.websocket import SocketOptions

_SEND_BUFFER_BYTES = 10_000_000


class BridgeParameters(NamedTuple):
    """Parameters of the node. ``longest_look_s``: the graph is looked at at least that often; ``probe_s``: how
    long a service may take to tell its type; ``warnings`` for its log.
    """

    endpoint: Endpoint
    longest_look_s: float
    probe_s: float
    socket: SocketOptions
    warnings: tuple


def read_parameters(get: Callable[[str, Any], Any]) -> BridgeParameters:
    """``get(name, default)`` returns a parameter of the node. Raises ParameterError."""
    address, access = str(get("address", "localhost")), access_of(get)
    capabilities = _texts(get, "capabilities", CAPABILITIES)
    # "time" follows from /use_sim_time.
    unknown = set(capabilities) - {*CAPABILITIES, "time"}
    if unknown:
        raise ParameterError("~capabilities has %s; known are %s"
                             % (", ".join(sorted(unknown)), ", ".join(CAPABILITIES)))
    rules = FoxgloveRules(
        _patterns(get, "topic_whitelist"), _patterns(get, "service_whitelist"), _patterns(get, "param_whitelist"),
        _patterns(get, "client_topic_whitelist"), _patterns(get, "asset_uri_allowlist", ASSETS, re.IGNORECASE),
        tuple(name for name in CAPABILITIES if name in capabilities))
    socket = SocketOptions(
        access, rules, use_compression=switch(get, "use_compression", False),
        buffer_bytes=int(number(get, "send_buffer_limit", _SEND_BUFFER_BYTES)))
    return BridgeParameters(
        Endpoint(port_of(get, 8765), address, tls_of(get, "tls")), max(0.1, number(get, "max_update_ms", 5000) / 1000),
        max(0.01, number(get, "service_type_retrieval_timeout_ms", 250) / 1000), socket, warnings_of(address, access))


def _texts(get: Callable[[str, Any], Any], name: str, default: Sequence[str]) -> Sequence[str]:
    values = get(name, default)
    if not isinstance(values, list | tuple) or not all(isinstance(value, str) for value in values):
        raise ParameterError("~%s is %r; a list of texts is expected, as ['/robot/.*', '/tf']" % (name, values))
    return values


def _patterns(get: Callable[[str, Any], Any], name: str, default: Sequence[str] = (".*",),
              flags: int | re.RegexFlag = 0) -> tuple[re.Pattern, ...]:
    try:
        return compiled(_texts(get, name, default), flags)
    except re.error as error:
        raise ParameterError("~%s: %r is no regular expression: %s" % (name, error.pattern, error)) from None
