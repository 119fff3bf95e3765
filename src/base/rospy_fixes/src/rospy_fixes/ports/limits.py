# SPDX-License-Identifier: BSD-3-Clause
"""The limits, each with its reason. ROS-free."""
from __future__ import annotations

#: From the connection to the end of its handshake header [s]. Clients send it at once; on a five times slower machine
#: they needed two seconds.
HANDSHAKE_S = 15.0
#: From the end of the handshake to the first byte of a service request [s], on a connection for one request.
REQUEST_S = 30.0
#: From the connection to the head of an XML-RPC request [s], from there to its answer [s], and from there to the next
#: request on the same connection [s]. Clients that keep a connection reconnect when it was closed.
XMLRPC_FIRST_S, XMLRPC_REQUEST_S, XMLRPC_IDLE_S = 15.0, 60.0, 120.0

#: Connections of one address that are in their handshake. On one machine all share 127.0.0.1: even 60 programs that
#: start in the same second have fewer, since a handshake takes milliseconds. Beyond it the oldest is closed.
HANDSHAKES_PER_ADDRESS = 256
#: XML-RPC connections of one address, idle or not, each of which has a thread. Beyond it the one that has waited
#: longest is closed.
XMLRPC_PER_ADDRESS = 256
#: Service connections of one address, each of which has a thread: 60 programs that keep 16 each. Beyond it new ones
#: are refused.
SERVICES_PER_ADDRESS = 1000
#: TCPROS connections of one address of all kinds: 60 programs with 100 topics each. Beyond it new ones are refused.
CONNECTIONS_PER_ADDRESS = 6000

#: Publishers of one topic that a call may name; each gets a thread. Classes have some hundred of /rosout.
PUBLISHERS = 4096

#: The longest handshake header [bytes]; it contains the message's whole definition, 60 kB for the largest in use.
HEADER_BYTES = 256 * 1024
#: The longest message or service request [bytes], unless the node's parameter ~largest_message_bytes says otherwise:
#: eight million points of a coloured cloud, ten pictures of a 4K camera.
MESSAGE_BYTES = 256 * 1024 * 1024

#: The node's own parameter for that.
SIZE_PARAMETER = "~largest_message_bytes"

#: Limit of open files that a node requests; the system's default of 1024 is not enough for a class.
OPEN_FILES = 65536


def size_fault(announced_bytes: int, limit_bytes: int) -> str:
    """The error text for a message that is too large."""
    return "a message of %d bytes is announced, at most %d are taken (parameter %s)" % (
        announced_bytes, limit_bytes, SIZE_PARAMETER)
