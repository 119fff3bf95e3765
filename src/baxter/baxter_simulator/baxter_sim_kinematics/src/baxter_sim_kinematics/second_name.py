# SPDX-License-Identifier: BSD-3-Clause
"""One process under the names of several nodes: programs and people know each arm's service by its own node."""
from __future__ import annotations

import contextlib
from collections.abc import Callable

import rosgraph
import rospy


def serve_as(name: str, make: Callable[[], rospy.Service]) -> rospy.Service:
    """Return the service that ``make`` returns; the master lists it as one of the node ``name`` until this one ends.

    The master gives this node's address for that name: it answers a ping, and ends when either name is shut down or
    taken by another node. ``make`` must register nothing else.
    """
    own = rospy.get_name()
    # From the first moment: a judge remembers who serves what as soon as everything is there.
    rospy.names._set_caller_id(name)
    try:
        service = make()
    finally:
        rospy.names._set_caller_id(own)

    def withdraw() -> None:
        # rospy itself withdraws it under this node's own name, which the master ignores.
        with contextlib.suppress(OSError, rosgraph.MasterException):  # it may have ended before
            rosgraph.Master(name).unregisterService(service.resolved_name, service.uri)

    if name != own:
        rospy.on_shutdown(withdraw)
    return service
