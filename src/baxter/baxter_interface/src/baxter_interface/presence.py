# SPDX-License-Identifier: BSD-3-Clause
"""Tell whether a topic still has a live publisher; a paused one counts."""
from __future__ import annotations

import threading
import time
import xmlrpc.client
from collections.abc import Callable
from urllib.parse import urlparse

import rosgraph
import rospy

from . import startup

# After this much silence, check whether the topic's publisher is still there, and repeat with this period [s, wall].
SILENT_AFTER_S = 1.0
_NO_ANSWER = (OSError, xmlrpc.client.Error, rosgraph.MasterException)


class Presence:
    """Watches the publishers of `topic` (resolved name); `silence_s()` returns the time since the last message [s,
    wall].

    A paused simulation is silent too, but not gone: its node answers. Cheap, callable from any thread.
    """

    def __init__(self, topic: str, silence_s: Callable[[], float]) -> None:
        self._topic = topic
        self._silence_s = silence_s
        self._lock = threading.Lock()
        self._probe_due_s = 0.0
        self._gone = False

    def is_gone(self) -> bool:
        """Whether the topic has no live publisher any more."""
        if self._silence_s() < SILENT_AFTER_S:
            self._gone = False
            return False
        with self._lock:
            due = time.monotonic() >= self._probe_due_s
            if due:
                self._probe_due_s = time.monotonic() + SILENT_AFTER_S
        if due:
            self._gone = not _has_living_publisher(self._topic)
        return self._gone


def _has_living_publisher(topic: str) -> bool:
    master = rosgraph.Master(rospy.get_name())
    try:
        nodes = dict(startup.system_state(master)[0]).get(topic, [])
    except _NO_ANSWER:
        return False
    for node in nodes:
        try:
            address = urlparse(str(master.lookupNode(node)))
            startup.connect(address.hostname or "", address.port or 0)  # port 0: nobody answers
            return True
        except _NO_ANSWER:
            continue
    return False
