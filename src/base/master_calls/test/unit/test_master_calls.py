# SPDX-License-Identifier: BSD-3-Clause
"""Calls to a ROS master always end."""
import socket
import threading
from xmlrpc.server import SimpleXMLRPCServer

import pytest
import rosgraph

import master_calls


@pytest.fixture
def silent():
    """The URI of a program that takes connections and never answers."""
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        listener.listen()
        yield "http://127.0.0.1:%d" % listener.getsockname()[1]


def test_who_does_not_answer_is_not_waited_for(silent):
    with pytest.raises(TimeoutError):
        master_calls.proxy(silent, 0.1).getPid("/caller")
    with pytest.raises(TimeoutError):
        master_calls.master("/caller", silent, 0.1).getSystemState()


def test_a_master_is_asked_in_the_name_of_the_caller():
    server = SimpleXMLRPCServer(("127.0.0.1", 0), logRequests=False)
    server.register_function(lambda caller, node: [1, "", caller + node] if node == "/known" else [-1, "unknown", ""],
                             "lookupNode")
    threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True).start()
    try:
        master = master_calls.master("/caller", "http://127.0.0.1:%d" % server.server_address[1], 10.0)
        assert master.lookupNode("/known") == "/caller/known"
        with pytest.raises(rosgraph.MasterError, match="unknown"):
            master.lookupNode("/other")
    finally:
        server.shutdown()
        server.server_close()
