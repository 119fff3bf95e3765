# SPDX-License-Identifier: BSD-3-Clause
"""Keeps the end of one connection from ending another one of the same topic.

The system gives the number of a closed descriptor to the next one that opens. rospy looks for a connection that has
ended by this number, so it found the newest one instead: a subscriber that had just connected was forgotten, and no
message ever came. rospy.wait_for_message in a loop met it, once in some thousand calls on a busy machine.
"""
from __future__ import annotations

import contextlib
import functools
from typing import Any


def amend(topics: Any) -> None:
    """Make the publishers and subscribers of rospy.topics tell connections apart by the connection itself.

    ``topics``: the module rospy.topics.
    """
    topics._TopicImpl._remove_connection = _remove_connection
    topics._TopicImpl.check = _locked(topics._TopicImpl.check)


def _remove_connection(self, connections, c):
    """Close connection ``c`` and take it out of ``connections`` (list), also where a queue of messages is around it."""
    transport = _transport(c)
    ended = [each for each in connections if _transport(each) is transport]
    descriptor = c.fileno()
    if not any(each.fileno() == descriptor for each in connections if each not in ended):
        with contextlib.suppress(Exception):  # it may have been closed, and then is watched no more
            self.connection_poll.remove_fd(descriptor)
    with contextlib.suppress(Exception):  # rospy logs what fails in closing
        c.close()
    for each in ended:
        with contextlib.suppress(ValueError):
            connections.remove(each)


def _transport(connection):
    # The publisher's queue of messages is rospy's QueuedConnection, which holds the connection itself.
    return getattr(connection, "_connection", connection)


def _locked(check):
    """``check``, which asks which descriptors are broken and then closes these: without a connection made between.

    It does not wait for the lock: rospy's caller holds the one of all topics, for which a listener of the thread that
    makes or ends a connection may wait. It is called twice a second.
    """
    @functools.wraps(check)
    def locked(self):
        lock = self.c_lock
        if lock is None or not lock.acquire(blocking=False):  # the topic is closed, or its connections are changing
            return
        try:
            check(self)
        finally:
            lock.release()
    return locked
