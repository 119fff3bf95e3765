# SPDX-License-Identifier: BSD-3-Clause
"""A subscriber gets what is published as soon as its connection has been answered."""
import os
import subprocess
import sys
from pathlib import Path

BASE = Path(__file__).resolve().parents[3]
OURS = ":".join(f"{BASE}/{name}/src" for name in ("rospy_fixes", "master_calls", "command_line"))
DEADLINE_S = 60.0
# The thread of a publisher's queue starts when the message has been published, or, where that waits, after a while.
PROGRAM = """
import socket, threading
import rospy
from rospy.impl import tcpros_pubsub
from rosgraph.network import read_ros_handshake_header
from io import BytesIO
from std_msgs.msg import String
rospy.core.set_initialized(True)
rospy.core.set_node_uri("http://localhost:1")
publisher = rospy.Publisher("/t", String, queue_size=QUEUE)
ours, theirs = socket.socketpair()
ours.settimeout(30.0)
published, add = threading.Event(), rospy.topics._TopicImpl.add_connection
def late(self, connection):
    published.wait(0.5)
    return add(self, connection)
rospy.topics._TopicImpl.add_connection = late
def publish():
    read_ros_handshake_header(ours, BytesIO(), 65536)
    publisher.publish("now")
    published.set()
thread = threading.Thread(target=publish)
thread.start()
header = {"topic": "/t", "md5sum": String._md5sum, "callerid": "/listener"}
print(tcpros_pubsub.TCPROSHandler().topic_connection_handler(theirs, ("", 0), header))
thread.join()
print(ours.recv(100)[-3:])
publisher.impl.close()
"""
GONE_AND_STUCK = """
import socket, threading
import rospy
from rospy.impl import tcpros_pubsub
from std_msgs.msg import String
rospy.core.set_initialized(True)
publisher = rospy.Publisher("/t", String, queue_size=1)
def connect(is_there):
    ours, theirs = socket.socketpair()
    if not is_there:
        ours.close()
    header = {"topic": "/t", "md5sum": String._md5sum, "callerid": "/listener"}
    try:
        print(tcpros_pubsub.TCPROSHandler().topic_connection_handler(theirs, ("", 0), header))
    except OSError as error:
        print(type(error).__name__)
connect(False)
[thread.join(30.0) for thread in threading.enumerate() if thread.name.endswith("(_run)")]
print(publisher.get_num_connections(), [one.name for one in threading.enumerate() if one.name.endswith("(_run)")])
free = threading.Event()
def publish():
    with publisher.impl.publock:
        free.wait(50.0)
writer = threading.Thread(target=publish)
writer.start()
connect(True)
print(publisher.get_num_connections(), writer.is_alive())
free.set()
writer.join()
publisher.impl.close()
"""

# A listener that waits for a thread which publishes, when a connection ends and when one begins.
REPLACED = """
import socket, threading
import rospy
from rospy.impl import tcpros_pubsub
from std_msgs.msg import String
rospy.core.set_initialized(True)
class Listener(rospy.SubscribeListener):
    def wait(self, text):
        thread = threading.Thread(target=publisher.publish, args=(text,), daemon=True)
        thread.start()
        thread.join(20.0)
        print(text, thread.is_alive(), flush=True)
    def peer_subscribe(self, topic, to_all, to_one):
        self.wait("begins")
    def peer_unsubscribe(self, topic, left):
        self.wait("ends")
        raise ValueError("a listener's error")
publisher = rospy.Publisher("/t", String, Listener(), queue_size=10)
pairs = [socket.socketpair(), socket.socketpair()]
for ours, theirs in pairs:
    header = {"topic": "/t", "md5sum": String._md5sum, "callerid": "/listener"}
    tcpros_pubsub.TCPROSHandler().topic_connection_handler(theirs, ("", 0), header)
print(publisher.get_num_connections(), flush=True)
import os
os._exit(0)  # a listener waits at the end, too
"""


def said(program):
    environment = {**os.environ, "PYTHONPATH": "%s:%s" % (OURS, os.environ.get("PYTHONPATH", ""))}
    done = subprocess.run([sys.executable, "-W", "ignore", "-c", program], capture_output=True, text=True,
                          timeout=DEADLINE_S, env=environment)
    assert done.stderr == ""
    return done.stdout.splitlines()


def test_the_first_message_after_the_answer_arrives():
    for queue in ("10", "None"):
        assert said(PROGRAM.replace("QUEUE", queue)) == ["None", "b'now'"]


def test_a_subscriber_that_has_gone_leaves_no_thread_and_a_message_that_is_stuck_lets_others_connect():
    assert said(GONE_AND_STUCK) == ["BrokenPipeError", "0 []", "None", "1 True"]


def test_a_listener_may_wait_for_a_message_to_be_published_and_fail():
    assert said(REPLACED) == ["begins False", "ends False", "begins False", "1"]
