# SPDX-License-Identifier: BSD-3-Clause
"""Connects a subscriber to each publisher once.

rospy learns of a topic's publishers from the master's answer when it subscribes, and from the master's calls when
publishers come. Where both name a publisher at the same moment, two threads connected to it. Publisher and subscriber
each keep one connection to a peer and close the other; where they kept different ones, none was left, and no message
ever came.
"""
from __future__ import annotations

import functools
import threading
from typing import Any


def amend(masterslave: Any) -> None:
    """Make the nodes of rospy.impl.masterslave connect to a publisher of a topic in one thread at a time; the next one
    finds the connection of the one before.
    """
    connect = masterslave.ROSHandler._connect_topic
    guard, under_way = threading.Lock(), {}  # (topic, publisher's address) -> [lock, number of threads]

    @functools.wraps(connect)
    def connect_once(self, topic, pub_uri):
        with guard:
            entry = under_way.setdefault((topic, pub_uri), [threading.Lock(), 0])
            entry[1] += 1
        try:
            with entry[0]:
                return connect(self, topic, pub_uri)
        finally:
            with guard:
                entry[1] -= 1
                if not entry[1]:
                    del under_way[topic, pub_uri]

    masterslave.ROSHandler._connect_topic = connect_once
