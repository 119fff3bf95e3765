# SPDX-License-Identifier: BSD-3-Clause
"""Makes a program send all published messages before it ends.

For a publisher with a queue, rospy sends in one thread per connection, and these threads end with the program: a
command in a program's last line was lost at random.
"""
from __future__ import annotations

import sys
import time
from typing import Any

# Longest delay of a program's end by a stopped reader [s, wall].
LONGEST_S = 2.0
_LOOK_EVERY_S = 0.002


def amend(core: Any) -> None:
    """Make the module rospy.core send queued messages before it shuts a node down."""
    core.add_preshutdown_hook(_before_shutdown)


def _before_shutdown(reason: str) -> None:
    # After Ctrl-C the user wants a quick end; and a signal may come while a needed lock is held.
    if not reason.startswith("signal"):
        await_sent(queued_connections())


def queued_connections() -> list[Any]:
    """Connections of this process's publishers that have a queue: list."""
    topics = sys.modules.get("rospy.topics")
    manager = topics and topics.get_topic_manager()
    publishers = list(manager.pubs.values()) if manager else []
    return [connection for publisher in publishers for connection in list(publisher.connections)
            if hasattr(connection, "_cond_data_available")]


def await_sent(connections: list[Any], longest_s: float = LONGEST_S) -> bool:
    """Wait until all connections' queues are sent to the system, at most ``longest_s`` [s]; returns whether."""
    end_s = time.monotonic() + longest_s
    while not all(map(_is_sent, connections)):
        if time.monotonic() > end_s:
            return False
        time.sleep(_LOOK_EVERY_S)
    return True


def _is_sent(connection: Any) -> bool:
    """Whether a rospy QueuedConnection's thread has sent everything: its queue is empty, and it waits for messages."""
    if connection.done:
        return True
    if not connection._lock.acquire(timeout=_LOOK_EVERY_S):
        return False
    try:
        return not connection._queue and bool(connection._cond_data_available._waiters)
    finally:
        connection._lock.release()
