# SPDX-License-Identifier: BSD-3-Clause
"""Messages and requests with a too large announced size are refused before they are read."""
from __future__ import annotations

import contextlib
import socket
import struct
from collections.abc import Callable
from typing import Any

import rospy
from rospy.exceptions import TransportTerminated
from rospy.impl.transport import INBOUND

from rospy_fixes.ports import limits
from rospy_fixes.ports.event_log import EventLog
from rospy_fixes.ports.shared import EVENTS

_LENGTH = struct.Struct("<I")
_known = []


class MessageTooLarge(TransportTerminated):
    """A message announces more bytes than allowed; rospy does not reconnect after this error."""


def largest_message_bytes() -> int:
    """The longest message or request that this node takes [bytes]: its parameter, read once, or the default."""
    if _known:
        return _known[0]
    value = limits.MESSAGE_BYTES
    try:
        value = rospy.get_param(limits.SIZE_PARAMETER, value)
    except Exception:  # noqa: BLE001  (no master at the moment: read again at the next call)
        return value
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not 1 <= value < 2**32:
        rospy.logerr("%s is %r, expected a number of bytes from 1 to %d; taking %d",
                     rospy.resolve_name(limits.SIZE_PARAMETER), value, 2**32 - 1, limits.MESSAGE_BYTES)
        value = limits.MESSAGE_BYTES
    _known.append(int(value))
    return _known[0]


def checked_read(read_messages: Callable[..., Any]) -> Callable[..., Any]:
    """``TCPROSTransportProtocol.read_messages``, which raises :class:`MessageTooLarge` before it waits for more."""

    def read(protocol: Any, buffer: Any, message_queue: Any, connection: socket.socket) -> Any:
        length, = _LENGTH.unpack(buffer.getbuffer()[:_LENGTH.size])
        if length > largest_message_bytes():
            raise MessageTooLarge(limits.size_fault(length, largest_message_bytes()))
        read_messages(protocol, buffer, message_queue, connection)

    return read


def checked_answer(read_messages: Callable[..., Any]) -> Callable[..., Any]:
    """``TCPROSServiceClient.read_messages``, with the same limit for what a service answers: its first byte says
    whether it is fine, then comes the length."""

    def read(protocol: Any, buffer: Any, message_queue: Any, connection: socket.socket) -> Any:
        if buffer.tell() > _LENGTH.size:
            length, = _LENGTH.unpack(buffer.getbuffer()[1:1 + _LENGTH.size])
            if length > largest_message_bytes():
                raise MessageTooLarge(limits.size_fault(length, largest_message_bytes()))
        read_messages(protocol, buffer, message_queue, connection)

    return read


def reported_receive(receive_once: Callable[..., Any], events: EventLog) -> Callable[..., Any]:
    """``TCPROSTransport.receive_once``, with a line about a publisher whose message is too large."""

    def receive(transport: Any) -> Any:
        try:
            return receive_once(transport)
        except MessageTooLarge as error:
            if transport.direction == INBOUND:
                with contextlib.suppress(AttributeError):
                    events.add(("size", transport.name, transport.callerid_pub),
                               "%s: the connection to %s is closed: %s"
                               % (transport.name, transport.callerid_pub, error))
            raise

    return receive


def amend(tcpros_base: Any) -> None:
    """Limit the size of messages and requests in rospy.impl.tcpros_base."""
    protocol, transport = tcpros_base.TCPROSTransportProtocol, tcpros_base.TCPROSTransport
    protocol.read_messages = checked_read(protocol.read_messages)
    transport.receive_once = reported_receive(transport.receive_once, EVENTS)
