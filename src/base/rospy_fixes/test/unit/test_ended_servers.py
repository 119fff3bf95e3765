# SPDX-License-Identifier: BSD-3-Clause
"""The thread of a node's server ends with the node."""
import os
import subprocess
import sys
from pathlib import Path

BASE = Path(__file__).resolve().parents[3]
OURS = ":".join(f"{BASE}/{name}/src" for name in ("rospy_fixes", "master_calls", "command_line"))
DEADLINE_S = 60.0
PROGRAM = """
import threading
from xmlrpc.client import ServerProxy
from rosgraph.xmlrpc import XmlRpcHandler, XmlRpcNode
class Handler(XmlRpcHandler):
    def hello(self):
        return "hello"
    def _ready(self, uri):
        ready.set()
    def end(self):
        node.shutdown("test")
        return "ended"
ready, node = threading.Event(), XmlRpcNode(0, Handler())
serving = threading.Thread(target=node.run, daemon=True)
serving.start()
ready.wait(30.0)
uri = node.uri
print(ServerProxy(uri).hello())
END
serving.join(20.0)
print("serves" if serving.is_alive() else "has ended")
node.shutdown("again")
"""


def said(end):
    done = subprocess.run([sys.executable, "-c", PROGRAM.replace("END", end)], capture_output=True, text=True,
                          timeout=DEADLINE_S,
                          env={**os.environ, "PYTHONPATH": "%s:%s" % (OURS, os.environ.get("PYTHONPATH", ""))})
    assert done.stderr == ""
    return done.stdout.splitlines()


def test_the_server_of_a_node_ends_with_it():
    assert said("node.shutdown('test')") == ["hello", "has ended"]


def test_a_request_may_end_its_own_server():
    assert said("print(ServerProxy(uri).end())") == ["hello", "ended", "has ended"]
