# SPDX-License-Identifier: BSD-3-Clause
import threading
from types import SimpleNamespace

import pytest

from rospy_fixes import one_connection

DEADLINE_S = 60.0


@pytest.fixture
def node():
    """A node as rospy's: it looks whether it is connected, asks the publisher, and connects.

    ``meet``: what it does while it asks.
    """
    class ROSHandler:
        def __init__(self):
            self.connections, self.meet = [], lambda: None

        def _connect_topic(self, topic, pub_uri):
            if (topic, pub_uri) in self.connections:
                return 1, "connected already", 0
            self.meet()
            self.connections.append((topic, pub_uri))
            return 1, "connected", 0

    one_connection.amend(SimpleNamespace(ROSHandler=ROSHandler))
    return ROSHandler()


def connect(node, *pairs):
    """Connect in one thread for each pair of topic and publisher, all at once."""
    threads = [threading.Thread(target=node._connect_topic, args=pair, daemon=True) for pair in pairs]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(DEADLINE_S)
        assert not thread.is_alive()


def test_two_threads_make_one_connection(node):
    both = threading.Barrier(2)

    def meet():
        try:
            both.wait(0.3)
        except threading.BrokenBarrierError:
            pass  # the other one waits for its turn

    node.meet = meet
    connect(node, ("/chatter", "http://talker"), ("/chatter", "http://talker"))
    assert node.connections == [("/chatter", "http://talker")]


@pytest.mark.parametrize("other", [("/chatter", "http://other"), ("/words", "http://talker")])
def test_other_publishers_and_topics_are_connected_meanwhile(node, other):
    both = threading.Barrier(2)
    node.meet = lambda: both.wait(DEADLINE_S)
    connect(node, ("/chatter", "http://talker"), other)
    assert sorted(node.connections) == sorted([("/chatter", "http://talker"), other])


def test_after_a_failure_the_next_one_tries(node):
    def fail():
        raise OSError("no answer")

    node.meet = fail
    with pytest.raises(OSError, match="no answer"):
        node._connect_topic("/chatter", "http://talker")
    node.meet = lambda: None
    assert node._connect_topic("/chatter", "http://talker")[1] == "connected"
    assert node._connect_topic("/chatter", "http://talker")[1] == "connected already"


def test_rospys_own_nodes_are_amended():
    from rospy.impl import masterslave

    if not hasattr(masterslave.ROSHandler._connect_topic, "__wrapped__"):
        one_connection.amend(masterslave)  # outside of the lab's environment
    assert masterslave.ROSHandler._connect_topic.__wrapped__.__code__.co_varnames[:3] == ("self", "topic", "pub_uri")
