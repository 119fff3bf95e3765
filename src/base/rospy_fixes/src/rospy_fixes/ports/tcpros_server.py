# SPDX-License-Identifier: BSD-3-Clause
"""Replaces rospy's server for topics and services."""
from __future__ import annotations

import socket
import threading
from collections.abc import Callable
from typing import Any

import rosgraph.network
import rospy.impl.tcpros_base as tcpros_base
from rospy.core import is_shutdown_requested

from rospy_fixes.ports.event_log import EventLog
from rospy_fixes.ports.handshakes import HandshakeServer
from rospy_fixes.ports.shared import EVENTS, FAULTS
from rospy_fixes.ports.threads import ThreadFaults

#: Connections that the kernel holds until they are accepted. rospy uses 5; beyond, clients wait for a second.
BACKLOG = 128
#: The longest reason of a refusal [characters]. It quotes the client, and a client that reads nothing must not hold up
#: the thread that accepts connections: so much a socket always takes.
LONGEST_REASON = 2000


def limited_server(events: EventLog, faults: ThreadFaults) -> type:
    """The replacement of the class ``rospy.impl.tcpros_base.TCPServer``."""

    class LimitedTCPServer(tcpros_base.TCPServer):
        def __init__(self, inbound_handler: Callable[..., Any], port: int = 0) -> None:
            super().__init__(inbound_handler, port)
            listener: Any = self.server_sock
            listener.listen(BACKLOG)
            self._handshakes = HandshakeServer(listener, inbound_handler, events, faults)

        def run(self) -> None:
            self._handshakes.run()

        def shutdown(self) -> None:
            self._handshakes.close()
            super().shutdown()

    return LimitedTCPServer


def connection_handler(events: EventLog) -> Callable[..., Any]:
    """The replacement of ``TCPROSServer._tcp_server_callback``: it gets the header that has been read."""

    def take(server: Any, connection: socket.socket, address: tuple[str, int], data: Any) -> None:
        try:
            header = rosgraph.network.decode_ros_handshake_header(data)
        except Exception as error:  # noqa: BLE001  (rosgraph's reader raises other errors, too, on what is no header)
            connection.close()
            events.add(("header", address[0]), "connection from %s:%d closed: no handshake header of ROS (%s)"
                       % (*address[:2], error))
            return
        if "topic" in header:
            # A latched message may have to wait for the client, or for another client that the publisher waits for.
            threading.Thread(target=_answer, name="handshake", daemon=True,
                             args=(server.topic_connection_handler, connection, address, header, events)).start()
        elif "service" in header:
            _answer(server.service_connection_handler, connection, address, header, events)
        else:
            _answer(lambda *_: "no topic or service name in the header", connection, address, header, events)

    return take


def _answer(handler: Any, connection: socket.socket, address: tuple[str, int], header: dict[str, str],
            events: EventLog) -> None:
    """Let rospy take over the connection, or send rospy's reason of refusal and close it."""
    try:
        reason = handler(connection, address, header)
        if not reason:
            return
        if is_shutdown_requested():
            reason = "node shutting down"
        else:
            events.add(("refused", header.get("callerid")), "connection of %s at %s:%d refused: %s"
                       % (header.get("callerid", "an unnamed node"), *address[:2], reason))
        rosgraph.network.write_ros_handshake_header(connection, {"error": reason[:LONGEST_REASON]})
    except Exception as error:  # noqa: BLE001  (anything may be sent, and a connection may end at any point)
        if not is_shutdown_requested():
            events.add(("failed", address[0]), "connection of %s at %s:%d failed: %s"
                       % (header.get("callerid", "an unnamed node"), *address[:2], error))
    connection.close()


def amend(tcpros_base: Any) -> None:
    """Give the servers of rospy.impl.tcpros_base a deadline and a number of connections."""
    tcpros_base.TCPServer = limited_server(EVENTS, FAULTS)
    tcpros_base.TCPROSServer._tcp_server_callback = connection_handler(EVENTS)
