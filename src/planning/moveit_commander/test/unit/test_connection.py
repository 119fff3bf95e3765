# SPDX-License-Identifier: BSD-3-Clause
"""How long programs wait for a move_group that does not answer."""
import socket
from types import SimpleNamespace

import pytest
import rosgraph
import rospy

from moveit_commander import connection

LIMIT_S = 0.05


@pytest.fixture
def waiting(monkeypatch):
    """wait(serves_after, node, names): waits for actions that are served at the so manieth look; node: what the master
    says where move_group's node is, an exception if nowhere. Returns what was logged."""
    def wait(serves_after, node, names=("move_group",)):
        looks, logged = [], []

        def served(_):
            looks.append(None)
            return len(looks) > serves_after

        def lookup(_, name):
            assert name == "/move_group"
            if isinstance(node, Exception):
                raise node
            return node

        monkeypatch.setattr(connection.MoveGroupConnection, "_client", lambda self,
                            _: SimpleNamespace(wait_for_server=served))
        monkeypatch.setattr(rosgraph.Master, "lookupNode", lookup)
        monkeypatch.setattr(rospy, "get_name", lambda: "/test")
        monkeypatch.setattr(rospy, "is_shutdown", lambda: False)
        monkeypatch.setattr(rospy, "logwarn", logged.append)
        connection.MoveGroupConnection("").wait_for_actions(names, LIMIT_S)
        return logged
    monkeypatch.setattr(connection, "_POLL_S", 0.02)
    return wait


@pytest.fixture
def node():
    """The address of a node that is there."""
    with socket.create_server(("localhost", 0)) as server:
        yield "http://localhost:%d/" % server.getsockname()[1]


def test_a_server_that_is_there_is_not_waited_for(waiting):
    assert waiting(0, rosgraph.MasterError("nobody")) == []


def test_a_move_group_that_starts_is_waited_for_and_that_is_said_once(waiting, node):
    (told,) = waiting(20, node)
    assert "move_group is starting" in told


@pytest.mark.parametrize("gone", [rosgraph.MasterError("unknown node"), "http://localhost:1/", "http://localhost:x/",
                                  "nonsense"])
def test_a_node_that_is_not_there_is_not(waiting, gone):
    with pytest.raises(RuntimeError, match="is move_group running.*roslaunch"):
        waiting(20, gone)


def test_an_action_that_a_running_move_group_does_not_have_is_not(waiting, node):
    with pytest.raises(RuntimeError, match="'/pickup' within allotted time"):
        waiting(20, node, ["pickup"])


def test_there_is_a_limit(waiting, node, monkeypatch):
    monkeypatch.setattr(connection, "START_WAIT_S", 0.1)
    with pytest.raises(RuntimeError, match="is move_group running"):
        waiting(10**6, node)
