# SPDX-License-Identifier: BSD-3-Clause
"""A topic's watch of its connections: which have broken, and the end of its descriptor."""
import gc
import os
import socket

import pytest

from rospy_fixes.ports.topic_poller import TopicPoller


@pytest.fixture
def pair():
    one, other = socket.socketpair()
    yield one, other
    one.close()
    other.close()


def test_a_connection_that_breaks_is_told_and_a_live_one_is_not(pair):
    poller = TopicPoller()
    poller.add_fd(pair[0].fileno())
    pair[1].send(b"x")
    assert list(poller.error_iter()) == []
    pair[1].close()
    assert list(poller.error_iter()) == [pair[0].fileno()]
    poller.remove_fd(pair[0].fileno())
    assert list(poller.error_iter()) == []


def test_its_descriptor_ends_with_it():
    def descriptors():
        return len(os.listdir("/proc/self/fd"))
    gc.disable()
    try:
        before = descriptors()
        pollers = [TopicPoller() for _ in range(5)]
        assert descriptors() == before + 5
        del pollers
        assert descriptors() == before
    finally:
        gc.enable()
