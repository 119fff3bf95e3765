# SPDX-License-Identifier: BSD-3-Clause
"""One simulator per ROS master.

A node that registers under a name which is in use shuts the older one down. For a simulator this would end a lab
silently, so a second one checks first and does not start.
"""
from __future__ import annotations

import contextlib
import os
import socket
import struct
import time
import xmlrpc.client
from typing import Any
from urllib.parse import urlsplit

import rosgraph

import master_calls

# Time limits for a connection, and for an answer [s]. A dead process refuses at once; a living one may be busy.
_CONNECT_S = 2.0
_ANSWER_S = 10.0
# Number of tries, and time between them [s], to take a claim that seems free.
_TRIES, _TRY_S = 20, 0.05
_PEER = struct.Struct("3i")  # struct ucred: process, user, group


def running_instance(node_name: str, caller_id: str = "/gazebo_ros_look_up",
                     master_uri: str | None = None) -> tuple[str, int | None] | None:
    """(URI, process id) of a living node that is registered as ``node_name``, or None.

    A dead node's registration does not count. A node that accepts connections without answering counts, with None for
    the process. Raises ``OSError`` when there is no master.
    """
    master: Any = rosgraph.Master(caller_id, master_uri)
    try:
        uri = master.lookupNode(node_name)
    except rosgraph.MasterError:
        return None
    address = urlsplit(uri)
    node: Any = master_calls.proxy(uri, _ANSWER_S)
    try:
        socket.create_connection((address.hostname, address.port), timeout=_CONNECT_S).close()
    except OSError:
        return None
    try:
        # Its port may belong to another node by now.
        code, _, name = node.getName(caller_id)
        if code == 1 and name != node_name:
            return None
    except TimeoutError:
        return uri, None
    except (OSError, xmlrpc.client.Error):
        pass  # not every client library returns its name
    try:
        code, _, pid = node.getPid(caller_id)
    except TimeoutError:
        return uri, None
    except (OSError, xmlrpc.client.Error):
        return None
    return (uri, pid) if code == 1 else None


class Claim:
    """This process's claim to start the simulator ``node_name`` on a master, held before the node is registered.

    It is a socket in Linux's abstract namespace, so it ends with the process in any case. It is visible on this machine
    only.
    """

    def __init__(self, node_name: str, master_uri: str) -> None:
        """Does not take the claim yet."""
        address = urlsplit(master_uri)
        host = address.hostname or ""
        if host in ("localhost", "::1") or host.startswith("127."):
            host = "localhost"
        self._name = "\0gazebo_ros simulator %s:%s %s" % (host, address.port, node_name)
        self._socket: socket.socket | None = None

    def take(self) -> int | None:
        """Take the claim and return None, or return the id of this user's process that holds it."""
        for _ in range(_TRIES):
            ours = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
            try:
                ours.bind(self._name)
                ours.listen()
            except OSError:
                ours.close()
            else:
                self._socket = ours
                return None
            with contextlib.suppress(OSError):
                return self._holder()
            time.sleep(_TRY_S)  # it is just being taken or released
        return None

    def release(self) -> None:
        """Release the claim; may be called twice."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _holder(self) -> int | None:
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
            probe.connect(self._name)
            pid, user, _ = _PEER.unpack(probe.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _PEER.size))
        # Other users' claims cannot block ours; their running simulator is visible at the master.
        return pid if user == os.getuid() else None


def refusal(node_name: str, uri: str, pid: int | None, master_uri: str | None = None) -> str:
    """The message, in three lines, when an instance runs already."""
    who = "process %d, %s" % (pid, uri) if pid else "%s, which does not answer at the moment" % uri
    return _refusal("A simulator is running on this ROS master", node_name, who, "rosnode kill %s" % node_name,
                    master_uri)


def refusal_while_starting(node_name: str, launch_pid: int, master_uri: str | None = None) -> str:
    """The message, in three lines, when another roslaunch is about to start an instance."""
    return _refusal("A simulator is being started on this ROS master", node_name,
                    "by roslaunch, process %d" % launch_pid, "kill -INT %d" % launch_pid, master_uri)


def _refusal(what: str, node_name: str, who: str, stop: str, master_uri: str | None) -> str:
    master_uri = master_uri or rosgraph.get_master_uri()
    address = urlsplit(master_uri)
    return ("%s (%s): node %s, %s. Nothing was started or changed.\n"
            "To stop it: press Ctrl-C in its terminal, or   %s\n"
            "To run a second one beside it: export ROS_MASTER_URI=http://%s:%d in each of its terminals, "
            "then start it again"
            % (what, master_uri, node_name, who, stop, address.hostname, (address.port or 11311) + 1))
