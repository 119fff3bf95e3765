# SPDX-License-Identifier: BSD-3-Clause
"""How a node learns of publishers and connects to them: rospy's thread for it lasts, and headers have a limit."""
from __future__ import annotations

import functools
import socket
import struct
from collections.abc import Callable
from typing import Any

import rosgraph.network
from rospy.core import is_shutdown

from rospy_fixes.ports import limits
from rospy_fixes.ports.shared import FAULTS
from rospy_fixes.ports.threads import ThreadFaults, lasting

_LENGTH = struct.Struct("<I")
_PORTION = 65536


def lasting_run(run: Callable, faults: ThreadFaults) -> Callable:
    """``rospy.impl.registration.RegManager.run``, again after each error, until the node ends."""
    @functools.wraps(run)
    def run_on(manager: Any) -> None:
        lasting(faults, "that connects to publishers", lambda _: run(manager))(
            lambda: manager.handler.done or is_shutdown())
    return run_on


def limited_update(update: Callable) -> Callable:
    """``ROSHandler.publisherUpdate``, which refuses what would cost a thread each for ever: more publishers than a
    topic can have, and addresses that nobody can be called at."""
    @functools.wraps(update)
    def limited(self: Any, *arguments: Any) -> Any:
        publishers = arguments[2] if len(arguments) == 3 and isinstance(arguments[2], list) else ()
        if len(publishers) > limits.PUBLISHERS:
            return -1, "%d publishers of a topic, at most %d are taken" % (len(publishers), limits.PUBLISHERS), 0
        for address in publishers:
            if isinstance(address, str) and not address.startswith("http://"):
                return -1, "%s is no address of a publisher, expected http://HOST:PORT/" % ascii(address[:100]), 0
        return update(self, *arguments)
    return limited


def read_header(connection: socket.socket, buffer: Any, _portion: Any = None) -> dict[str, str]:
    """The replacement of ``read_ros_handshake_header`` where a subscriber or a client reads the other side's header.

    ``buffer`` (BytesIO) afterwards holds what came behind it; what is left in it from an earlier connection is dropped.
    Raises ``rosgraph.network.ROSHandshakeException``, also for a header that is too long, and what
    ``decode_ros_handshake_header`` raises.
    """
    data, wanted = bytearray(), _LENGTH.size
    while len(data) < wanted:
        portion = connection.recv(_PORTION)
        if not portion:
            raise rosgraph.network.ROSHandshakeException("closed by the other side after %d bytes of its header"
                                                         % len(data))
        data += portion
        if len(data) >= _LENGTH.size:
            length, = _LENGTH.unpack_from(data)
            if length > limits.HEADER_BYTES:
                raise rosgraph.network.ROSHandshakeException(
                    "the other side announces a header of %d bytes, at most %d are taken"
                    % (length, limits.HEADER_BYTES))
            wanted = _LENGTH.size + length
    buffer.seek(0)
    buffer.truncate()
    buffer.write(data[wanted:])
    return rosgraph.network.decode_ros_handshake_header(bytes(data[:wanted]))


def amend(module: Any) -> None:
    """Amend rospy.impl.tcpros_base (headers), rospy.impl.registration or rospy.impl.masterslave."""
    if hasattr(module, "read_ros_handshake_header"):
        module.read_ros_handshake_header = read_header
    elif hasattr(module, "ROSHandler"):
        module.ROSHandler.publisherUpdate = limited_update(module.ROSHandler.publisherUpdate)
    else:
        module.RegManager.run = lasting_run(module.RegManager.run, FAULTS)
