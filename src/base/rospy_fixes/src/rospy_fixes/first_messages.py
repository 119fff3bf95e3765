# SPDX-License-Identifier: BSD-3-Clause
"""Lets a subscriber that is connected get everything that is published from then on.

A publisher of rospy answers a subscriber first, and notes the connection then; for one with a queue it starts a thread
in between, which on a busy machine takes a while. The subscriber counts the connection from the answer on. The result
of a goal that it sent at once was published to nobody.
"""
from __future__ import annotations

import contextlib
import functools
import threading
from typing import Any

from rospy.impl.tcpros_base import TCPROSTransport
from rospy.impl.tcpros_pubsub import TCPROSHandler

# Longest wait of a new subscriber for a message that is being written to one that does not read [s, wall].
LONGEST_S = 1.0


def amend(topics: Any) -> None:
    """Make the publishers of rospy.topics answer a subscriber and note its connection in one step."""
    taking = threading.local()
    handler: Any = TCPROSHandler
    take = handler.topic_connection_handler
    write, add = TCPROSTransport.write_header, topics._TopicImpl.add_connection

    @functools.wraps(take)
    def topic_connection_handler(self, *arguments):
        taking.now = True
        try:
            return take(self, *arguments)
        finally:
            taking.now = False

    @functools.wraps(write)
    def write_header(self):
        # A publisher's is written below.
        if not getattr(taking, "now", False):
            write(self)

    @functools.wraps(add)
    def add_connection(self, connection):
        if not getattr(taking, "now", False):
            return add(self, connection)
        taking.now = False
        # What is published waits for this lock. Listeners of the topic, which may wait for others, are told without it:
        # connections that this one would end, end before.
        for other in self.connections:
            if other.endpoint_id == connection.endpoint_id:
                with contextlib.suppress(Exception):  # as closed_connections: a listener's error keeps nobody out
                    other.close()
        self.check()
        lock = self.publock or threading.RLock()  # a topic that has ended has none
        is_held = lock.acquire(timeout=LONGEST_S)
        try:
            write(getattr(connection, "_connection", connection))  # without the publisher's queue
            return add(self, connection)
        except BaseException:
            connection.close()  # and with it the queue's thread
            raise
        finally:
            if is_held:
                lock.release()

    handler.topic_connection_handler = topic_connection_handler
    TCPROSTransport.write_header, topics._TopicImpl.add_connection = write_header, add_connection
