# SPDX-License-Identifier: BSD-3-Clause
"""A publisher accepts subscribers while the shutdown handlers of its node run, and none after that."""
import os
import subprocess
import sys
from pathlib import Path

BASE = Path(__file__).resolve().parents[3]
OURS = ":".join(f"{BASE}/{name}/src" for name in ("rospy_fixes", "master_calls", "command_line"))
DEADLINE_S = 60.0
PROGRAM = """
import socket, threading
import rospy
from rospy.impl.tcpros_pubsub import TCPROSHandler
from std_msgs.msg import String
rospy.core.set_initialized(True)
publisher = rospy.Publisher("/t", String, queue_size=10)
def connect(when):
    ours, theirs = socket.socketpair()
    header = {"topic": "/t", "md5sum": String._md5sum, "callerid": "/listener"}
    def take():
        refusal = TCPROSHandler().topic_connection_handler(ours, ("", 0), header)
        print(when + ":", refusal, rospy.core.is_shutdown_requested())
    thread = threading.Thread(target=take, daemon=True)
    thread.start()
    thread.join(20.0)
connect("before")
for handler in HANDLERS:
    rospy.on_shutdown(lambda: connect("handler"))
rospy.core.add_preshutdown_hook(lambda _: connect("after"))
rospy.signal_shutdown("test")
"""


def said(handlers):
    program = PROGRAM.replace("HANDLERS", "range(%d)" % handlers)
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=DEADLINE_S,
                          env={**os.environ, "PYTHONPATH": "%s:%s" % (OURS, os.environ.get("PYTHONPATH", ""))})
    assert done.stderr == ""
    return done.stdout.splitlines()


def test_subscribers_are_accepted_until_the_handlers_have_run():
    accepted = ["handler: None True"]
    assert said(2) == ["before: None False", *accepted, *accepted, "after: Node is shutting down True"]


def test_a_node_without_handlers_accepts_none():
    assert said(0) == ["before: None False", "after: Node is shutting down True"]
