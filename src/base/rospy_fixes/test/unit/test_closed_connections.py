# SPDX-License-Identifier: BSD-3-Clause
import threading

import pytest
import rospy.topics
from rospy.impl.tcpros_pubsub import QueuedConnection
from rospy.impl.transport import Transport
from std_msgs.msg import String

from rospy_fixes import closed_connections

DEADLINE_S = 60.0


class Connection(Transport):
    """A connection with the descriptor ``number``, which does not change when it is closed: as rospy's."""

    def __init__(self, number, endpoint_id):
        super().__init__(direction=0, name="/chatter")
        self.number, self.endpoint_id = number, endpoint_id

    def fileno(self):
        return self.number

    def close(self):
        if not self.done:  # as TCPROSTransport; without it the topic's callback closes it again, without end
            super().close()


class Watched:
    """The descriptors that a topic watches; ``broken``: those that it is told to be broken."""

    def __init__(self):
        self.numbers, self.broken, self.when_asked = set(), [], lambda: None

    def add_fd(self, number):
        self.numbers.add(number)

    def remove_fd(self, number):
        self.numbers.remove(number)

    def error_iter(self):
        broken = [number for number in self.broken if number in self.numbers]
        self.when_asked()
        return broken


@pytest.fixture
def topic():
    """A publisher's connections, amended."""
    if not hasattr(rospy.topics._TopicImpl.check, "__wrapped__"):
        closed_connections.amend(rospy.topics)  # outside of the lab's environment
    implementation = rospy.topics._PublisherImpl("/chatter", String)
    implementation.connection_poll = Watched()
    return implementation


def test_the_end_of_a_connection_leaves_the_next_one_with_its_number(topic):
    first, second = Connection(5, "/listener"), Connection(5, "/listener")
    topic.add_connection(first)
    first.close()
    topic.add_connection(second)
    topic.remove_connection(first)
    assert topic.connections == [second]
    assert not second.done
    assert topic.connection_poll.numbers == {5}


def test_a_connection_that_ends_is_removed_and_watched_no_more(topic):
    first, second = Connection(5, "/listener"), Connection(6, "/other")
    topic.add_connection(first)
    topic.add_connection(second)
    topic.remove_connection(first)
    assert topic.connections == [second]
    assert first.done
    assert topic.connection_poll.numbers == {6}


def test_a_connection_with_a_queue_is_found_by_what_is_in_it(topic):
    inner = Connection(5, "/listener")
    topic.add_connection(QueuedConnection(inner, 10))
    assert len(topic.connections) == 1
    inner.close()
    assert topic.connections == []


def test_a_second_connection_of_the_same_subscriber_replaces_the_first(topic):
    first, second = Connection(5, "/listener"), Connection(6, "/listener")
    topic.add_connection(first)
    topic.add_connection(second)
    assert topic.connections == [second]
    assert first.done and not second.done


def test_broken_connections_are_closed_without_one_made_between(topic):
    first, second = Connection(5, "/listener"), Connection(5, "/listener")
    topic.add_connection(first)
    watched = topic.connection_poll
    watched.broken = [5]
    asked, replaced = threading.Event(), threading.Event()

    def replace():
        asked.wait(DEADLINE_S)
        watched.broken = []
        topic.add_connection(second)
        replaced.set()

    def when_asked():
        asked.set()
        replaced.wait(0.3)  # a thread that need not wait for the lock is done by then

    watched.when_asked = when_asked
    thread = threading.Thread(target=replace, daemon=True)
    thread.start()
    topic.check()
    watched.when_asked = lambda: None
    thread.join(DEADLINE_S)
    assert not thread.is_alive()
    assert first.done
    assert topic.connections == [second]
    assert not second.done


def test_a_closed_topic_is_not_asked(topic):
    topic.add_connection(Connection(5, "/listener"))
    topic.close()
    topic.check()


def test_the_check_does_not_wait_for_a_connection_that_is_being_made(topic):
    topic.add_connection(Connection(5, "/listener"))
    topic.connection_poll.broken = [5]
    held, checked = threading.Event(), threading.Event()

    def hold():
        with topic.c_lock:
            held.set()
            checked.wait(DEADLINE_S)

    holder = threading.Thread(target=hold, daemon=True)
    holder.start()
    assert held.wait(DEADLINE_S)
    checker = threading.Thread(target=topic.check, daemon=True)
    checker.start()
    checker.join(DEADLINE_S)
    assert not checker.is_alive() and len(topic.connections) == 1
    checked.set()
    holder.join(DEADLINE_S)
    topic.check()
    assert topic.connections == []
