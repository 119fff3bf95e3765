# SPDX-License-Identifier: BSD-3-Clause
"""Ctrl-C while the node is starting: it ends at once, whatever rospy is busy with."""
import os
import re
import signal
import subprocess
import sys
import threading
from pathlib import Path
from socketserver import ThreadingMixIn
from xmlrpc.server import SimpleXMLRPCServer

import pytest

from lab_testing.waiting import wait_until

PACKAGE = Path(__file__).resolve().parents[2]
NODE = "/ik_node_that_ends"
# rospy's own thread for new connections may still be waiting on the socket that its shutdown has just closed.
SHUTDOWN_OF_ROSPY = re.compile(r"Exception in thread.*?tcpros_base.*?OSError: [^\n]*Bad file descriptor\n", re.DOTALL)


class _Server(ThreadingMixIn, SimpleXMLRPCServer):
    daemon_threads = True


class _Master:
    """A ROS master with the calls that a starting node makes. Calls `on_call(name, arguments)` before each answer."""

    def __init__(self, parameters):
        self._parameters = parameters
        self.on_call = lambda name, arguments: None
        self._server = _Server(("localhost", 0), logRequests=False, allow_none=True)
        self._server.register_instance(self)
        self.uri = "http://localhost:%d" % self._server.server_address[1]
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    def close(self):
        self._server.shutdown()
        self._server.server_close()

    def _dispatch(self, name, arguments):
        self.on_call(name, arguments)
        if name == "hasParam":
            return 1, "", arguments[1] in self._parameters
        if name == "getParam":
            known = arguments[1] in self._parameters
            return (1, "", self._parameters[arguments[1]]) if known else (-1, "not set", 0)
        return 1, "", [] if name in ("registerPublisher", "registerSubscriber") else 1


@pytest.fixture
def master(baxter_xml):
    master = _Master({
        "/robot_description": baxter_xml,
        NODE + "/limb": "left",
    })
    yield master
    master.close()


def is_pending(pid, number):
    """Whether a process has a signal that it has not handled yet."""
    status = Path("/proc/%d/status" % pid).read_text()
    waiting = [int(line.split()[1], 16) for line in status.splitlines() if line.startswith(("SigPnd:", "ShdPnd:"))]
    return any(mask >> (number - 1) & 1 for mask in waiting)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("call, subject", [
    ("registerPublisher", "/rosout"), ("registerPublisher", "/ExternalTools/left/PositionKinematicsNode/IKReport"),
    ("registerService", "/ExternalTools/left/PositionKinematicsNode/IKService")])
def test_a_signal_during_a_registration_ends_the_node(master, call, subject, number):
    reached = threading.Event()
    environment = dict(os.environ, ROS_MASTER_URI=master.uri, ROS_HOSTNAME="localhost")
    node = subprocess.Popen([sys.executable, str(PACKAGE / "nodes" / "position_kinematics"), "__name:=" + NODE[1:]],
                            env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)

    def strike(name, arguments):
        if name == call and arguments[1] == subject and not reached.is_set():
            node.send_signal(number)
            # rospy is in the middle of this call, with its lock in hand, when the signal is handled.
            wait_until(lambda: not is_pending(node.pid, number), "the signal to be handled")
            reached.set()

    master.on_call = strike
    try:
        assert reached.wait(60.0), "the node does not get as far as %s of %s" % (call, subject)
        # A node that waits for a lock of its own main thread never ends; a loaded machine may take seconds.
        output, _ = node.communicate(timeout=90.0)
        assert "Traceback" not in SHUTDOWN_OF_ROSPY.sub("", output)
    finally:
        node.kill()
