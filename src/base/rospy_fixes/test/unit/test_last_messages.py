# SPDX-License-Identifier: BSD-3-Clause
"""Queued messages of a publisher are sent before a program ends, with rospy's own queues over pairs of sockets."""
import socket
import threading

import pytest
from rospy.impl.tcpros_base import TCPROSTransport, TCPROSTransportProtocol
from rospy.impl.tcpros_pubsub import QueuedConnection

from rospy_fixes import last_messages

MESSAGE, COUNT = b"x" * 100_000, 50


@pytest.fixture
def ends():
    """(the queue of a publisher's connection, the socket of its reader)."""
    ours, theirs = socket.socketpair()
    transport = TCPROSTransport(TCPROSTransportProtocol("/t", None), "/t")
    transport.socket = ours
    connection = QueuedConnection(transport, 0)
    yield connection, theirs
    theirs.close()
    transport.done = True
    with connection._lock:
        connection._cond_data_available.notify()
    connection._thread.join(60.0)
    ours.close()


def read_all(reader, count):
    while count > 0:
        count -= len(reader.recv(1 << 20))


def test_what_is_queued_is_sent(ends):
    connection, reader = ends
    for _ in range(COUNT):
        connection.write_data(MESSAGE)
    thread = threading.Thread(target=read_all, args=(reader, COUNT * len(MESSAGE)))
    thread.start()
    assert last_messages.await_sent([connection], 60.0)
    thread.join(60.0)
    assert not thread.is_alive() and not connection._queue


def test_a_reader_that_has_stopped_is_not_waited_for_without_end(ends):
    connection, reader = ends
    for _ in range(COUNT):
        connection.write_data(MESSAGE)
    assert not last_messages.await_sent([connection], 0.1)
    reader.close()


def test_a_lock_that_is_held_is_not_waited_for_without_end(ends):
    connection, _ = ends
    with connection._lock:
        assert not last_messages.await_sent([connection], 0.1)
    assert last_messages.await_sent([connection], 60.0)


def test_a_connection_that_has_ended_has_nothing_to_send(ends):
    connection, _ = ends
    connection._connection.done = True
    assert last_messages.await_sent([connection], 0.0)
