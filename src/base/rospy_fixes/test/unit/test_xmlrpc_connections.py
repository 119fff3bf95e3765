# SPDX-License-Identifier: BSD-3-Clause
"""Which ends of XML-RPC connections are told."""
import socket

import pytest

from rospy_fixes.ports import limits
from rospy_fixes.ports.xmlrpc_server import Connections


class Told(list):
    """An EventLog that keeps the texts."""

    def add(self, _, text):
        self.append(text)


@pytest.fixture
def server():
    """Connections whose clock is ``now[0]``, the texts of their events, and a function that opens one more."""
    now, told, pairs = [0.0], Told(), []
    connections = Connections(told, clock=lambda: now[0])

    def opened():
        pairs.append(socket.socketpair())
        connections.add(pairs[-1][0], "10.0.0.1")
        return pairs[-1]
    yield now, told, connections, opened
    for pair in pairs:
        for end in pair:
            end.close()


def test_a_client_that_has_been_served_and_is_idle_is_closed_without_a_word(server):
    now, told, connections, opened = server
    here, there = opened()
    connections.allow(here, limits.XMLRPC_REQUEST_S)
    connections.allow(here, limits.XMLRPC_IDLE_S, quiet=True)
    now[0] = limits.XMLRPC_IDLE_S
    connections.expire()
    assert there.recv(1) == b"" and told == []


def test_one_that_never_asks_or_stops_in_a_request_is_told(server):
    now, told, connections, opened = server
    opened()
    here, _ = opened()
    connections.allow(here, limits.XMLRPC_IDLE_S, quiet=True)
    connections.allow(here, limits.XMLRPC_REQUEST_S)
    now[0] = limits.XMLRPC_REQUEST_S
    connections.expire()
    assert told == ["XML-RPC connection from 10.0.0.1 closed: no request came in time"] * 2


def test_one_too_many_is_told(server, monkeypatch):
    _, told, _, opened = server
    monkeypatch.setattr(limits, "XMLRPC_PER_ADDRESS", 2)
    for _ in range(3):
        opened()
    assert told == ["XML-RPC connection from 10.0.0.1 closed: one of more than 2"]
