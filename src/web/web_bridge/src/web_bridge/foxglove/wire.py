# SPDX-License-Identifier: BSD-3-Clause
"""Frames of the Foxglove WebSocket protocol: operations in JSON, and binary frames (little-endian)."""
from __future__ import annotations

import json
import struct
from typing import TYPE_CHECKING, Any, NamedTuple

from web_bridge.errors import FieldError, FrameError, shown
from web_bridge.fields import field

if TYPE_CHECKING:
    from _struct import Struct

#: In the server's order; a client's first match counts.
SUBPROTOCOLS = ("foxglove.websocket.v1", "foxglove.sdk.v1")
INFO, WARNING, ERROR = 0, 1, 2
LARGEST_ID = 2 ** 32 - 1

_MESSAGE, _TIME, _RESPONSE, _ASSET = 1, 2, 3, 4
_CLIENT_MESSAGE, _REQUEST = 1, 2
_MESSAGE_HEADER = struct.Struct("<BIQ")
_CLIENT_HEADER = struct.Struct("<BI")
_CALL_HEADER = struct.Struct("<BIII")
_ASSET_HEADER = struct.Struct("<BIBI")
_CLOCK = struct.Struct("<II")


class ClientMessage(NamedTuple):
    """A message that a client publishes."""

    channel_id: int
    data: bytes


class ServiceRequest(NamedTuple):
    """A client's call of a service."""

    service_id: int
    call_id: int
    encoding: str
    data: bytes


def text(op: str, **fields: Any) -> str:
    """A JSON frame; fields that are None are left out."""
    return json.dumps({"op": op, **{name: value for name, value in fields.items() if value is not None}},
                      separators=(",", ":"))


def message_frame(subscription_id: int, received_ns: int, data: bytes) -> bytes:
    return _MESSAGE_HEADER.pack(_MESSAGE, subscription_id, received_ns) + data


def time_frame(time_ns: int) -> bytes:
    return struct.pack("<BQ", _TIME, time_ns)


def response_frame(request: ServiceRequest, data: bytes) -> bytes:
    """The answer to a ServiceRequest, in its encoding."""
    encoding = request.encoding.encode()
    return _CALL_HEADER.pack(_RESPONSE, request.service_id, request.call_id, len(encoding)) + encoding + data


def asset_frame(request_id: int, data: bytes = b"", error: str = "") -> bytes:
    """A file; with ``error`` the reason why there is none."""
    reason = error.encode()
    return _ASSET_HEADER.pack(_ASSET, request_id, bool(reason), len(reason)) + reason + data


def nanoseconds(secs: int, nsecs: int) -> int:
    return secs * 1_000_000_000 + nsecs


def time_of_clock(data: bytes) -> int:
    """The time in a serialized rosgraph_msgs/Clock [ns]. Raises FrameError."""
    if len(data) != _CLOCK.size:
        raise FrameError("%d bytes are no rosgraph_msgs/Clock" % len(data))
    return nanoseconds(*_CLOCK.unpack(data))


def read_text(frame: str | bytes) -> dict[str, Any]:
    """The operation (dict) of a text frame. Raises FrameError."""
    try:
        operation = json.loads(frame)
    except (ValueError, RecursionError) as error:
        raise FrameError("%s is no JSON object: %s" % (shown(frame), error)) from None
    if not isinstance(operation, dict):
        raise FrameError("%s is no JSON object" % shown(frame))
    return operation


def read_binary(frame: bytes) -> ClientMessage | ServiceRequest:
    """The ClientMessage or ServiceRequest of a binary frame. Raises FrameError."""
    op = frame[0] if frame else None
    if op == _CLIENT_MESSAGE:
        _, channel_id = _unpacked(_CLIENT_HEADER, frame)
        return ClientMessage(channel_id, frame[_CLIENT_HEADER.size:])
    if op == _REQUEST:
        _, service_id, call_id, length = _unpacked(_CALL_HEADER, frame)
        begin, end = _CALL_HEADER.size, _CALL_HEADER.size + length
        if end > len(frame):
            raise FrameError("the name of an encoding has %d bytes, and the frame ends after %d bytes"
                             % (length, len(frame) - begin))
        try:
            return ServiceRequest(service_id, call_id, frame[begin:end].decode(), frame[end:])
        except UnicodeDecodeError as error:
            raise FrameError("the name of an encoding is no UTF-8: %s" % error) from None
    raise FrameError("a binary frame of %d bytes begins with %s; a client sends %d (message) or %d (service request)"
                     % (len(frame), op, _CLIENT_MESSAGE, _REQUEST))


def _unpacked(header: Struct, frame: bytes) -> tuple[int, ...]:
    if len(frame) < header.size:
        raise FrameError("a binary frame of type %d has %d bytes; at least %d are expected"
                         % (frame[0], len(frame), header.size))
    return header.unpack_from(frame)


def number(value: Any, name: str) -> int:
    """A number of 32 bits: an id. Raises FieldError."""
    if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value <= LARGEST_ID:
        raise FieldError("%s is %s; a whole number from 0 to %d is expected" % (name, shown(value), LARGEST_ID))
    return value


def entries(operation: dict[str, Any], name: str, kind: type) -> list[Any]:
    """A list of objects of one kind. Raises FieldError."""
    values = field(operation, name, list)
    for value in values:
        if not isinstance(value, kind) or isinstance(value, bool):
            raise FieldError("%s holds %s; %s is expected" % (name, shown(value), kind.__name__))
    return values
