# SPDX-License-Identifier: BSD-3-Clause
"""Parameters that the nodes of this room share: numbers, switches, TLS, tokens and origins. No ROS.

``get(name, default)`` returns a parameter of the node. All functions raise ParameterError.
"""
from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from web_bridge.access import Access, is_loopback


class ParameterError(ValueError):
    """A parameter with a value that cannot be served; the text names it and says what can."""


class Endpoint(NamedTuple):
    """Where a node listens: ``address`` "" is every network; ``tls`` (certfile, keyfile) or None; ``retry_s``: after
    which a taken port is tried again [s].
    """

    port: int
    address: str
    tls: tuple | None = None
    retry_s: float = 5.0


def switch(get: Callable[[Any, Any], Any], name: str, default: bool) -> bool:
    value = get(name, default)
    if value in (None, ""):
        return default
    if not isinstance(value, bool):
        raise ParameterError("~%s is %r; true or false is expected" % (name, value))
    return value


def number(get: Callable[[Any, Any], Any], name: str, default: float) -> float:
    """A number; nothing and "None", as published launch files write it, are the default."""
    value = get(name, default)
    if value in (None, "", "None"):
        return default
    try:
        if isinstance(value, bool) or not 0 <= float(value) < 1e12:
            raise ValueError
    except (TypeError, ValueError):
        raise ParameterError("~%s is %r; a number from 0 on is expected" % (name, value)) from None
    return float(value)


def port_of(get: Callable[..., Any], default: int) -> int:
    port = int(number(get, "port", default))
    if not 0 <= port <= 65535:
        raise ParameterError("~port is %d; 0 to 65535 is possible" % port)
    return port


def tls_of(get: Callable[[str, str], Any], name: str) -> tuple[str, str] | None:
    """(certfile, keyfile) where the switch ``name`` is on, else None."""
    if not switch(get, name, False):
        return None
    certfile = str(get("certfile", ""))
    if not certfile:
        raise ParameterError("~%s is true and ~certfile is empty; give the file of the certificate" % name)
    return certfile, str(get("keyfile", ""))


def access_of(get: Callable[[str, str], Any]) -> Access:
    """~token, ~view_token, ~allowed_origins, ~websocket_null_origin."""
    may_act, may_watch = str(get("token", "")), str(get("view_token", ""))
    if may_watch and not may_act:
        raise ParameterError("~view_token is set, and ~token is not: without it everybody may act; set both")
    tokens = {may_act: True, **({may_watch: False} if may_watch else {})} if may_act else {}
    if len(tokens) == 1 and may_watch:
        raise ParameterError("~token and ~view_token are the same; a client that only watches needs another one")
    return Access(tokens, str(get("allowed_origins", "")).split(),
                  switch(get, "websocket_null_origin", False) or bool(tokens))


def warnings_of(address: str, access: Access, risk: str = "move the robot") -> tuple[str, ...]:
    """Warnings for the node's log about an address and an Access; ``risk``: what everybody could do there."""
    if access.needs_token or is_loopback(address):
        return ()
    return ("this port is open to other machines, and everybody on them can %s; with ~token set, only clients that "
            "have it may connect" % risk,)
