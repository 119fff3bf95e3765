# SPDX-License-Identifier: BSD-3-Clause
"""Replaces rospy's code that serves one connection of a service."""
from __future__ import annotations

import collections
import select
import socket
import struct
import threading
from collections.abc import Callable
from typing import Any

from rospy.exceptions import TransportException, TransportTerminated

from rospy_fixes.ports import limits
from rospy_fixes.ports.event_log import EventLog
from rospy_fixes.ports.messages import MessageTooLarge, checked_answer
from rospy_fixes.ports.shared import EVENTS, FAULTS
from rospy_fixes.ports.threads import SURVIVED, ThreadFaults

#: Before an error's text: that the request failed, and the text's length.
_ERROR = struct.Struct("<BI")


class _Counts:
    """Number of connections of each address."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._counts = collections.Counter()

    def enter(self, host: str) -> bool:
        with self._lock:
            if self._counts[host] >= limits.SERVICES_PER_ADDRESS:
                return False
            self._counts[host] += 1
            return True

    def leave(self, host: str) -> None:
        with self._lock:
            self._counts[host] -= 1
            if not self._counts[host]:
                del self._counts[host]


def connection_server(events: EventLog, faults: ThreadFaults) -> Callable[..., Any]:
    """The replacement of ``rospy.impl.tcpros_service.ServiceImpl.handle``. Runs in the connection's thread."""
    counts = _Counts()

    def handle(service: Any, transport: Any, header: dict[str, str]) -> None:
        if header.get("probe") == "1":
            transport.close()
            return
        try:
            host = transport.socket.getpeername()[0]
        except (AttributeError, OSError):
            transport.close()
            return
        caller = "%s at %s" % (header.get("callerid"), host)
        if not counts.enter(host):
            text = "%s has %d service connections to this node already" % (host, limits.SERVICES_PER_ADDRESS)
            _refuse(service, transport, text)
            events.add(("services", host), "%s: connection of %s refused: %s" % (service.resolved_name, caller, text))
            return
        try:
            _serve(service, transport, header.get("persistent", "").lower() in ("1", "true"), caller, events)
        except SURVIVED as error:
            faults.note("that serves a request", error, "%s: connection of %s closed" % (service.resolved_name, caller))
        finally:
            counts.leave(host)
            transport.close()

    return handle


def write_error(service: Any, transport: Any, text: str) -> None:
    """The replacement of ``ServiceImpl._write_service_error``. A text may quote half of a surrogate pair, which cannot
    be sent; rospy then sends nothing."""
    data = text.encode("utf-8", "backslashreplace")
    transport.write_data(_ERROR.pack(0, len(data)) + data)


def _serve(service: Any, transport: Any, is_persistent: bool, caller: str, events: EventLog) -> None:
    if not is_persistent and not _has_come(transport, limits.REQUEST_S):
        events.add(("request", service.resolved_name), "%s: connection of %s closed: no request within %g s"
                   % (service.resolved_name, caller, limits.REQUEST_S))
        return
    try:
        while True:
            for request in transport.receive_once():
                service._handle_request(transport, request)
                _forget_unsent(transport.write_buff)
            if not is_persistent:
                return
    except TransportTerminated as error:
        if isinstance(error, MessageTooLarge):
            _reject(service, transport, caller, error, events)
        # Otherwise the client has gone.
    except (TransportException, OSError) as error:
        _reject(service, transport, caller, error, events)


def _forget_unsent(buffer: Any) -> None:
    """Drop a partly serialized response: it would be sent in front of the next one."""
    if buffer.tell():
        buffer.seek(0)
        buffer.truncate()


def _reject(service: Any, transport: Any, caller: str, error: BaseException, events: EventLog) -> None:
    text = "request refused: %s" % error
    events.add(("request", service.resolved_name, caller), "%s: connection of %s closed: %s"
               % (service.resolved_name, caller, text))
    _refuse(service, transport, text)


def _has_come(transport: Any, timeout_s: float) -> bool:
    """Whether a first byte arrives in time; the end of the connection counts as one."""
    poller = select.poll()
    try:
        poller.register(transport.socket, select.POLLIN)
        return bool(poller.poll(1000.0 * timeout_s))
    except (AttributeError, OSError, ValueError, TypeError):
        return True  # closed from this side meanwhile


def _refuse(service: Any, transport: Any, text: str) -> None:
    """Send the reason, which the client gets as the text of a ServiceException, and close."""
    try:
        service._write_service_error(transport, text)
        _read_away(transport.socket)
    except (AttributeError, OSError, TransportException, TransportTerminated):
        pass
    transport.close()


def _read_away(connection: socket.socket, most_bytes: int = 1 << 20, wait_s: float = 0.5) -> None:
    """Read some of the sent bytes: closing with unread bytes would reset the connection before the client reads the
    answer."""
    connection.settimeout(wait_s)
    while most_bytes > 0:
        portion = connection.recv(65536)
        if not portion:
            return
        most_bytes -= len(portion)


def amend(tcpros_service: Any) -> None:
    """Replace what serves a connection in rospy.impl.tcpros_service; limit the size of a client's answers."""
    client, service = tcpros_service.TCPROSServiceClient, tcpros_service.ServiceImpl
    client.read_messages = checked_answer(client.read_messages)
    service.handle, service._write_service_error = connection_server(EVENTS, FAULTS), write_error
