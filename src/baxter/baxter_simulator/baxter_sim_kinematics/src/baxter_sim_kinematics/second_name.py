# SPDX-License-Identifier: BSD-3-Clause
"""One process under the names of several nodes: programs and people know each arm's service by its own node."""
from __future__ import annotations

import contextlib

import rosgraph
import rospy


def list_under(name: str, service: rospy.Service) -> None:
    """Make the master list ``service``, which this node serves, as one of the node ``name`` until this node ends.

    The master gives this node's address for that name: it answers a ping, and ends when either name is shut down or
    taken by another node. Raises ``rosgraph.MasterException`` and ``OSError`` where the master does not do so.
    """
    master = rosgraph.Master(name)
    master.registerService(service.resolved_name, service.uri, rospy.get_node_uri())

    def withdraw() -> None:
        # rospy itself withdraws it under this node's name alone, which the master then ignores.
        with contextlib.suppress(OSError, rosgraph.MasterException):  # it may have ended before
            master.unregisterService(service.resolved_name, service.uri)

    rospy.on_shutdown(withdraw)
