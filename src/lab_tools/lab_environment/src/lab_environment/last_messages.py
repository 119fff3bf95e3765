# SPDX-License-Identifier: BSD-3-Clause
"""Have a program send all that it has published before it ends.

rospy hands messages of a publisher with a queue to a thread for each connection, and a program that ends takes these
threads with it: a command that was the last line of a program got lost, or not, as the machine pleased.
"""
import sys
import time

# So long may a reader that has stopped hold up the end of a program [s, wall].
LONGEST_S = 2.0
_LOOK_EVERY_S = 0.002


def amend(core):
    """Have the module rospy.core send what is queued before it shuts a node down."""
    core.add_preshutdown_hook(_before_shutdown)


def _before_shutdown(reason):
    # The user who presses Ctrl-C wants an end; and a signal may have come where a lock is held that is needed here.
    if not reason.startswith("signal"):
        await_sent(queued_connections())


def queued_connections():
    """Connections of this process's publishers that have a queue: list."""
    topics = sys.modules.get("rospy.topics")
    manager = topics and topics.get_topic_manager()
    publishers = list(manager.pubs.values()) if manager else []
    return [connection for publisher in publishers for connection in list(publisher.connections)
            if hasattr(connection, "_cond_data_available")]


def await_sent(connections, longest_s=LONGEST_S):
    """Wait until all connections' queues are handed to the system, at most ``longest_s`` [s]; returns whether."""
    end_s = time.monotonic() + longest_s
    while not all(map(_is_sent, connections)):
        if time.monotonic() > end_s:
            return False
        time.sleep(_LOOK_EVERY_S)
    return True


def _is_sent(connection):
    """Whether a rospy QueuedConnection's thread has nothing left: it waits for messages then, with an empty queue."""
    if connection.done:
        return True
    if not connection._lock.acquire(timeout=_LOOK_EVERY_S):
        return False
    try:
        return not connection._queue and bool(connection._cond_data_available._waiters)
    finally:
        connection._lock.release()
