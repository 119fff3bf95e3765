# SPDX-License-Identifier: BSD-3-Clause
"""Which registrations mean a living simulator, and which process may start one."""
import contextlib
import os
import signal
import socket
import subprocess
import sys
import threading
from xmlrpc.server import SimpleXMLRPCServer

import pytest

from lab_testing.waiting import wait_until
from master_calls import single_instance
from master_calls.single_instance import Claim, refusal, refusal_while_starting, running_instance

NODE = "/gazebo"


@pytest.fixture
def serve():
    """Makes XML-RPC servers of functions; returns their URIs."""
    with contextlib.ExitStack() as ending:
        def start(**functions):
            server = SimpleXMLRPCServer(("127.0.0.1", 0), logRequests=False)
            for name, function in functions.items():
                server.register_function(function, name)
            threading.Thread(target=server.serve_forever, daemon=True).start()
            ending.callback(server.server_close)
            ending.callback(server.shutdown)
            return "http://127.0.0.1:%d/" % server.server_address[1]

        yield start


def master_that_knows(serve, uri):
    return serve(lookupNode=lambda caller, name: [1, "", uri] if uri else [-1, "unknown node", ""])


def test_a_node_that_answers_runs(serve):
    uri = serve(getPid=lambda caller: [1, "", 4711], getName=lambda caller: [1, "", NODE])
    assert running_instance(NODE, master_uri=master_that_knows(serve, uri)) == (uri, 4711)


def test_a_node_of_a_library_that_does_not_know_its_name_runs(serve):
    uri = serve(getPid=lambda caller: [1, "", 4711])
    assert running_instance(NODE, master_uri=master_that_knows(serve, uri)) == (uri, 4711)


def test_what_is_not_registered_does_not_run(serve):
    assert running_instance(NODE, master_uri=master_that_knows(serve, "")) is None


def test_the_registration_of_a_dead_node_does_not_count(serve):
    with socket.create_server(("127.0.0.1", 0)) as gone:
        uri = "http://127.0.0.1:%d/" % gone.getsockname()[1]
    assert running_instance(NODE, master_uri=master_that_knows(serve, uri)) is None


def test_a_dead_node_whose_port_another_node_has_does_not_count(serve):
    uri = serve(getPid=lambda caller: [1, "", 4711], getName=lambda caller: [1, "", "/somebody"])
    assert running_instance(NODE, master_uri=master_that_knows(serve, uri)) is None


def test_a_dead_node_whose_port_something_else_has_does_not_count(serve):
    assert running_instance(NODE, master_uri=master_that_knows(serve, serve())) is None


def test_a_node_that_stands_still_counts(serve, monkeypatch):
    monkeypatch.setattr(single_instance, "_ANSWER_S", 0.2)
    with socket.create_server(("127.0.0.1", 0)) as stopped:
        uri = "http://127.0.0.1:%d/" % stopped.getsockname()[1]
        assert running_instance(NODE, master_uri=master_that_knows(serve, uri)) == (uri, None)


def test_no_master_is_an_error():
    with socket.create_server(("127.0.0.1", 0)) as gone:
        uri = "http://127.0.0.1:%d/" % gone.getsockname()[1]
    with pytest.raises(OSError):
        running_instance(NODE, master_uri=uri)


TAKE_AND_STAY = """
import signal, sys
from master_calls.single_instance import Claim
claim = Claim(sys.argv[1], sys.argv[2])
print(claim.take(), flush=True)
signal.pause()
"""


@pytest.fixture
def holder():
    """Another process that holds the claim for a master that does not exist, in every spelling of its name."""
    node = "/gazebo_of_%d" % os.getpid()
    process = subprocess.Popen([sys.executable, "-c", TAKE_AND_STAY, node, "http://127.0.0.1:11499"],
                               stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "None\n"
    process.node = node
    yield process
    process.kill()
    process.wait()
    process.stdout.close()


def test_a_claim_is_had_by_one_process(holder):
    assert Claim(holder.node, "http://localhost:11499/").take() == holder.pid
    for other in (Claim(holder.node, "http://localhost:11500"), Claim(holder.node + "2", "http://localhost:11499")):
        assert other.take() is None
        other.release()


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_a_claim_ends_with_its_process(holder, number):
    holder.send_signal(number)
    holder.wait()
    claim = Claim(holder.node, "http://localhost:11499")
    wait_until(lambda: claim.take() is None, "the claim to be free")
    claim.release()


def test_a_claim_that_was_given_back_can_be_taken():
    first, second = (Claim("/gazebo_again_%d" % os.getpid(), "http://localhost:11499") for _ in range(2))
    assert first.take() is None
    assert second.take() == os.getpid()
    first.release()
    assert second.take() is None
    second.release()


@pytest.mark.parametrize("text", [
    refusal(NODE, "http://x:1/", 4711, "http://localhost:11311"), refusal(NODE, "http://x:1/", None, "http://localhost:11311"),
    refusal_while_starting(NODE, 4711, "http://localhost:11311")])
def test_a_refusal_says_in_three_lines_what_is_there_and_what_can_be_done(text):
    assert len(text.splitlines()) == 3
    for part in (NODE, "http://localhost:11311", "To stop it", "ROS_MASTER_URI=http://localhost:11312"):
        assert part in text
