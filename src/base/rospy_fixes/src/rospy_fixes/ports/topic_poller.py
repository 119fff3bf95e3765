# SPDX-License-Identifier: BSD-3-Clause
"""The descriptor that rospy opens for each topic of a node, closed as soon as the topic is."""
from __future__ import annotations

import select
from typing import Any

_BROKEN = select.EPOLLHUP | select.EPOLLERR | select.EPOLLRDHUP


class TopicPoller:
    """The replacement of the class ``rospy.topics.Poller``, with its methods: tells which connections have broken.

    rospy's own one keeps its methods as attributes, and so refers to itself: its descriptor stays open
    until the garbage collector looks for reference cycles, in a large node after many minutes.
    """

    def __init__(self) -> None:
        self._epoll = select.epoll()

    def add_fd(self, descriptor: int) -> None:
        """Watch a connection."""
        self._epoll.register(descriptor, _BROKEN)

    def remove_fd(self, descriptor: int) -> None:
        """Forget a connection."""
        self._epoll.unregister(descriptor)

    def error_iter(self) -> list[int]:
        """The descriptors of the connections that have broken."""
        return [descriptor for descriptor, event in self._epoll.poll(0) if event & _BROKEN]


def amend(topics: Any) -> None:
    """Give the topics of rospy.topics this descriptor."""
    topics.Poller = TopicPoller
