# SPDX-License-Identifier: BSD-3-Clause
"""Access control of clients: Origin, tokens, patterns of names. No ROS.

A handshake of a WebSocket is not subject to a browser's same-origin policy: any page that a user opens could connect to
a server on that user's machine. A page is therefore only let in from this machine's own names, or from origins that the
operator lists.
"""
from __future__ import annotations

import fnmatch
import hmac
import ipaddress
import socket
from collections.abc import Sequence
from typing import Any, NamedTuple
from urllib.parse import urlsplit

from web_bridge.errors import RequestForbidden, shown

#: The last part of the names of parameters that hold a server's tokens: whoever reads the first one may move the robot.
_TOKENS = {"token", "view_token"}
#: How the names of those services of rosapi begin that change something, set_logger_level of every node among them.
_CHANGING = ("/rosapi/set_", "/rosapi/delete_")


class Rules(NamedTuple):
    """Names that a client may use. Lists of patterns as of fnmatch; an empty list allows everything.

    ``may_act`` False: the client may subscribe and ask rosapi, no more.
    """

    topics: tuple = ()
    services: tuple = ()
    may_act: bool = True

    def check_topic(self, topic: str) -> None:
        """Raise RequestForbidden unless a pattern allows the topic."""
        if self.topics and not any(fnmatch.fnmatchcase(topic, pattern) for pattern in self.topics):
            raise RequestForbidden("topics_glob of this server does not allow the topic %s" % topic)

    def check_service(self, service: str) -> None:
        """Raise RequestForbidden unless a pattern allows the service; rosapi's are always allowed."""
        patterns = (*self.services, "/rosapi/*")
        if self.services and not any(fnmatch.fnmatchcase(service, pattern) for pattern in patterns):
            raise RequestForbidden("services_glob of this server does not allow the service %s" % service)
        if not self.may_act and (not service.startswith("/rosapi/") or service.startswith(_CHANGING)):
            raise RequestForbidden("the view token does not allow to call %s" % service)

    def check_may_act(self, what: str) -> None:
        """Raise RequestForbidden for a client that may only watch."""
        if not self.may_act:
            raise RequestForbidden("the view token does not allow to %s" % what)


def is_token(name: str) -> bool:
    """Is a parameter of this name a server's token? A client that may only watch must not read how to become one that
    acts. The name decides, because a server may have been started with one of the two.
    """
    return name.rpartition("/")[2] in _TOKENS


def without_tokens(value: Any) -> Any:
    """A parameter's value without the tokens of servers, at any depth."""
    if not isinstance(value, dict):
        return value
    return {name: without_tokens(part) for name, part in value.items() if not is_token(name)}


def patterns_of(text: str) -> tuple[str, ...]:
    """The list in a parameter such as "['/robot/*', '/camera']"; "[*]" and "[]" allow everything, and give ()."""
    parts = [part.strip().strip("'\"").strip() for part in text.strip().removeprefix("[").removesuffix("]").split(",")]
    found = tuple(part for part in parts if part)
    return () if "*" in found else found


def origin_of(address: str) -> str:
    """The origin of a page's address; a text that is none, such as "null", as it is."""
    try:
        parts = urlsplit(address)
    except ValueError:
        return address
    return "%s://%s" % parts[:2] if parts.netloc else address


def is_loopback(name: str) -> bool:
    """Is this host name or address (no port) one of the loopback device?"""
    if name.rstrip(".").lower() == "localhost":
        return True
    try:
        return ipaddress.ip_address(name.strip("[]")).is_loopback
    except ValueError:
        return False


def host_of(text: str) -> str:
    """The host in "host:port", "[::1]:80" or a URL's origin, in lower case; "" where there is none."""
    try:
        return (urlsplit(text if "//" in text else "//" + text).hostname or "").lower()
    except ValueError:
        return ""


class Access:
    """Decides whether a client may connect.

    ``tokens`` {token: may act}, empty: everybody who reaches the port may act. ``origins``: further origins, as
    "https://host:port", or "*". ``null_origin``: pages without an origin, such as files. ``names``: names of this
    machine.
    """

    def __init__(self, tokens: dict[str, bool] | None = None, origins: Sequence[str] = (), null_origin: bool = False,
                 names: list[str] | None = None) -> None:
        self._tokens = dict(tokens or {})
        self._origins = {origin.rstrip("/").lower() for origin in origins}
        self._null_origin = null_origin
        self._names = {name.lower() for name in (own_names() if names is None else names)}

    @property
    def needs_token(self) -> bool:
        return bool(self._tokens)

    def check_origin(self, origin: str | None, host: str) -> None:
        """Raise RequestForbidden unless a page of this origin (a header's text, None: no browser) may connect to this
        ``host`` header.
        """
        if origin is None or "*" in self._origins or origin.rstrip("/").lower() in self._origins:
            return
        if origin == "null":
            if not self._null_origin:
                raise RequestForbidden("a page without an origin (a file, a frame in a sandbox) may not connect; "
                                       "serve it over HTTP from this machine, or set websocket_null_origin:=true")
            return
        page, server = host_of(origin), host_of(host or "")
        if not self._is_own(server) or not (page == server or (is_loopback(page) and is_loopback(server))):
            raise RequestForbidden("a page of %s may not connect to %s; the parameter ~allowed_origins lists those "
                                   "that may"
                                   % (origin, host))

    def check_host(self, host: str) -> None:
        """Raise RequestForbidden unless the ``host`` header of a request without an origin names this machine; who has
        a token may use any name.
        """
        server = host_of(host or "")
        if not (self._tokens or "*" in self._origins or self._is_own(server)
                or server in {host_of(origin) for origin in self._origins}):
            raise RequestForbidden("%s is no name of this machine that is known; use its address, or list http://%s "
                                   "in the parameter ~allowed_origins" % (shown(host), host))

    def _is_own(self, server: str) -> bool:
        """Is it a name of this machine? A foreign name that resolves to it must not pass as its own."""
        return is_loopback(server) or server in self._names or _is_address(server)

    def may_act(self, token: str) -> bool:
        """Whether a client with this token ("": none) may act. Raises RequestForbidden where the token is wrong."""
        if not self._tokens:
            return True
        for known, may_act in self._tokens.items():
            if hmac.compare_digest(known.encode(), token.encode("utf-8", "surrogateescape")):
                return may_act
        raise RequestForbidden("the token is wrong" if token else "a token is needed: ws://host:port/?token=…")


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


def own_names() -> set[str]:
    """The names under which pages of this machine are opened."""
    name = socket.gethostname()
    return {name, name + ".local", name.partition(".")[0]}
