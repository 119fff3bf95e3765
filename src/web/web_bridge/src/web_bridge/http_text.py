# SPDX-License-Identifier: BSD-3-Clause
"""Requests that are passed on to another HTTP server, and its answers, as text: what is passed on, and what not. No
sockets.

The other server is not trusted: its pages have the same origin as all pages of this one, so an answer must not set
cookies for other paths, nor register workers for them.
"""
from __future__ import annotations

from http.cookies import CookieError, SimpleCookie

from tornado.httputil import HTTPHeaders, HTTPInputError

# Headers of an answer that are passed on.
_ANSWER = frozenset((
    "Accept-Ranges", "Cache-Control", "Content-Disposition", "Content-Encoding", "Content-Length", "Content-Range",
    "Content-Security-Policy", "Content-Type", "Date", "Etag", "Expires", "Last-Modified", "Referrer-Policy", "Vary",
    "X-Content-Type-Options"))
# Of a request: what belongs to one connection, or is told to the lab in another way.
_NOT_PASSED = frozenset((
    "Connection", "Content-Length", "Cookie", "Expect", "Forwarded", "Host", "Keep-Alive", "Origin",
    "Proxy-Authorization", "Proxy-Connection", "Referer", "Te", "Trailer", "Transfer-Encoding", "Upgrade"))
# A masked frame of a client's WebSocket: its first byte, and the second one with the length. The page's heartbeats are
# the texts "beat" and "busy" (4 bytes); browsers answer pings by pongs.
_MASK_BYTES, _TEXT, _PONG, _BEAT_LENGTH, _MASKED = 4, 0x81, 0x8A, 4, 0x80
#: An answer's head may have this size [bytes].
LARGEST_HEAD = 65536


class BadAnswer(Exception):
    """An answer that cannot be passed on; the text says why."""


def is_upgrade(headers: HTTPHeaders) -> bool:
    """Does a request want a WebSocket?"""
    return headers.get("Upgrade", "").lower() == "websocket"


def request_head(method: str, uri: str, headers: HTTPHeaders, length: int, upgrade: bool = False,
                 own_cookie: str = "") -> bytes:
    """The head of a request as bytes. uri: path and query; length: of the body [bytes]; own_cookie: name of the cookie
    that is not passed on.

    HTTP/1.0, unless it is an upgrade: the answer then ends with its connection, and is never in pieces.
    """
    lines = ["%s %s HTTP/1.%d" % (method, uri, upgrade), "Host: localhost"]
    for name, value in headers.get_all():
        if name not in _NOT_PASSED and "\r" not in value and "\n" not in value:
            lines.append("%s: %s" % (name, value))
    cookies = without_cookie(headers.get("Cookie", ""), own_cookie)
    if cookies:
        lines.append("Cookie: " + cookies)
    if upgrade:
        lines += ["Connection: Upgrade", "Upgrade: websocket", "Origin: http://localhost"]
    else:
        lines += ["Connection: close", *(["Content-Length: %d" % length] if length else [])]
    return "\r\n".join([*lines, "", ""]).encode("utf-8", "surrogateescape")


def without_cookie(text: str, name: str) -> str:
    """A header "Cookie" without the cookie of this name."""
    parts = [part.strip() for part in text.split(";")]
    return "; ".join(part for part in parts if part and part.partition("=")[0].strip() != name)


def answer_head(data: bytes) -> tuple[int, HTTPHeaders]:
    """(status, HTTPHeaders) of an answer's head as bytes, up to the empty line. Raises BadAnswer."""
    first, _, rest = data.decode("latin-1").partition("\r\n")
    words = first.split(None, 2)
    if len(words) < 2 or not words[0].startswith("HTTP/1.") or not words[1].isdecimal() or len(words[1]) != 3:
        raise BadAnswer("it answered %r instead of HTTP" % first[:60])
    try:
        headers = HTTPHeaders.parse(rest)
    except (HTTPInputError, ValueError) as error:
        raise BadAnswer("its headers cannot be read: %s" % error) from None
    if "Transfer-Encoding" in headers:
        raise BadAnswer("it answered in chunks, which HTTP/1.0 does not have")
    return int(words[1]), headers


def passed_on(headers: HTTPHeaders, outside: str, inside: str = "", own_cookie: str = "") -> list[tuple[str, str]]:
    """The (name, value) of an answer's headers for the client.

    outside, inside: the path of the other server as clients see it, and as it does itself, such as "/anna" and "";
    own_cookie: name of a cookie that it must not set.
    """
    found = [(name, value) for name, value in headers.get_all() if name in _ANSWER]
    location = headers.get("Location")
    if location:
        is_path = location.startswith(inside + "/") and not location.startswith("//")
        found.append(("Location", outside + location[len(inside):] if is_path else location))
    narrowed = (_narrow(text, outside, own_cookie) for text in headers.get_list("Set-Cookie"))
    return found + [("Set-Cookie", cookie) for cookie in narrowed if cookie]


def _narrow(text: str, outside: str, own_cookie: str) -> str:
    """A cookie of the other server, for its own path; "" for one that cannot be read, or of the name own_cookie."""
    try:
        cookies = SimpleCookie(text)
    except CookieError:
        return ""
    if len(cookies) != 1 or own_cookie in cookies:
        return ""
    cookie, = cookies.values()
    cookie["domain"] = ""
    if not cookie["path"].startswith(outside + "/"):
        cookie["path"] = outside + "/"
    return cookie.OutputString()


def upgrade_text(headers: HTTPHeaders) -> bytes:
    """The head of the answer that makes a WebSocket of the client's connection, from the headers of
    the answer."""
    lines = ["HTTP/1.1 101 Switching Protocols", "Upgrade: websocket", "Connection: Upgrade"]
    lines += ["%s: %s" % (name, value) for name, value in headers.get_all() if name.startswith("Sec-Websocket-")]
    return "\r\n".join([*lines, "", ""]).encode("latin-1")


def is_heartbeat(chunk: bytes) -> bool:
    """Are these bytes of a WebSocket's client nothing but heartbeats of the page, and pongs?"""
    place = 0
    while place + 2 <= len(chunk):
        kind, length = chunk[place], chunk[place + 1] - _MASKED
        if not (kind == _TEXT and length == _BEAT_LENGTH or kind == _PONG and 0 <= length < 126):
            return False
        place += 2 + _MASK_BYTES + length
    return place == len(chunk)
