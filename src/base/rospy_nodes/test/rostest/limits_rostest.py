#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Attacks on the ports of a node; its service and its topics go on working."""
import contextlib
import os
import re
import socket
import struct
import threading
import time
import unittest
from pathlib import Path
from xmlrpc.client import ServerProxy

import rosgraph
import rospy
import rostest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rosgraph.network import write_ros_handshake_header
from rosgraph_msgs.msg import Log
from std_msgs.msg import String
from std_srvs.srv import SetBool

from lab_testing.waiting import wait_until

NODE = "/limited"
DEADLINE_S = 90.0
LIMIT_BYTES = 1_000_000
SILENT = 500


class RospyLimits(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.lines = []
        cls.log = rospy.Subscriber("/rosout", Log, lambda line: cls.lines.append(line.msg) if line.name == NODE else 0)
        cls.serve = rospy.ServiceProxy("serve", SetBool)
        cls.serve.wait_for_service(DEADLINE_S)
        master = rosgraph.Master("/limits_test")
        cls.uri = master.lookupNode(NODE)
        cls.pid = ServerProxy(cls.uri).getPid("/limits_test")[2]
        cls.xmlrpc = re.match(r"http://(.*):(\d+)", cls.uri).groups()
        cls.tcpros = re.match(r"rosrpc://(.*):(\d+)", master.lookupService("/serve")).groups()

    def setUp(self):
        self.held = contextlib.ExitStack()
        self.addCleanup(self.held.close)
        self.check_heard("heard")

    def check_heard(self, topic):
        """A new publisher and a new subscriber get through."""
        heard = []
        publisher = rospy.Publisher(topic, String, queue_size=1)
        subscriber = rospy.Subscriber("echo", String, lambda message: heard.append(message.data))
        try:
            wait_until(lambda: publisher.publish(topic) or topic in heard, "the echo of %s" % topic, DEADLINE_S, 0.05)
        finally:
            subscriber.unregister()
            publisher.unregister()

    def connect(self, where, data=b""):
        connection = self.held.enter_context(socket.create_connection((where[0], int(where[1])), timeout=DEADLINE_S))
        connection.sendall(data)
        return connection

    def handshake(self, **header):
        connection = self.connect(self.tcpros)
        write_ros_handshake_header(connection, {"callerid": "/stranger", "md5sum": "*", **header})
        return connection

    def check_alive(self):
        answers = []
        caller = threading.Thread(target=lambda: answers.append(self.serve(True).message), daemon=True)
        caller.start()
        caller.join(DEADLINE_S)
        self.assertEqual(answers, ["served"])
        with socket.create_connection((self.tcpros[0], int(self.tcpros[1])), timeout=DEADLINE_S) as subscriber:
            write_ros_handshake_header(subscriber, {"callerid": "/new", "md5sum": "*", "topic": "/echo", "type": "*"})
            self.assertGreater(len(subscriber.recv(4)), 0)
        code, text, pid = ServerProxy(self.uri).getPid("/limits_test")
        self.assertEqual((code, pid), (1, self.pid), text)

    def said(self, *parts):
        return [line for line in self.lines if all(part in line for part in parts)]

    def descriptors(self):
        return len(os.listdir("/proc/%d/fd" % self.pid))

    def threads(self):
        return len(list(Path("/proc/%d/task" % self.pid).iterdir()))

    def test_silent_connections_on_the_port_for_topics_and_services(self):
        for _ in range(SILENT):
            self.connect(self.tcpros)
        self.check_alive()
        wait_until(lambda: self.said("no complete handshake"), "a line about them", DEADLINE_S)
        self.assertEqual(len(self.said("no complete handshake")), 1)

    def test_silent_connections_on_the_xmlrpc_port(self):
        for _ in range(SILENT):
            self.connect(self.xmlrpc)
        self.check_alive()
        wait_until(lambda: self.said("XML-RPC"), "a line about them", DEADLINE_S)
        wait_until(lambda: self.threads() < 100, "their threads to end, by the deadline", 60.0)

    def test_services_that_are_connected_and_never_asked(self):
        for _ in range(SILENT):
            self.handshake(service="/serve", persistent="1")
        self.check_alive()

    def test_a_subscriber_that_does_not_read_a_latched_message(self):
        for _ in range(3):
            self.handshake(topic="/latched", type="*")
        self.check_alive()

    def test_garbage(self):
        for data in (struct.pack("<I", 2**32 - 1), b"GET / HTTP/1.1\r\n\r\n", os.urandom(2000),
                     struct.pack("<I", 8) + b"\xff" * 8, struct.pack("<II", 8, 4) + b"=x=y", struct.pack("<I", 0),
                     struct.pack("<II", 6, 2) + b"\xff=", struct.pack("<I", 3) + b"\x02\0\0"):
            self.connect(self.tcpros, data)
            self.connect(self.xmlrpc, data)
        self.connect(self.xmlrpc, b"POST / HTTP/1.1\r\nContent-Length: 4294967296\r\n\r\n")
        self.check_alive()

    def test_a_thread_that_an_error_ends_is_told_on_diagnostics(self):
        with self.assertRaises(rospy.ServiceException):
            rospy.ServiceProxy("fail", SetBool)(True)
        status = rospy.wait_for_message("/diagnostics", DiagnosticArray, DEADLINE_S).status[0]
        self.assertEqual((status.name, status.level), (NODE + ": threads", DiagnosticStatus.WARN))
        self.assertIn("ZeroDivisionError", status.values[0].value)
        self.check_alive()

    def test_connections_that_are_opened_and_dropped_leave_nothing(self):
        for where in (self.tcpros, self.xmlrpc):
            before = self.descriptors()
            for turn in range(1000):
                with socket.create_connection((where[0], int(where[1])), timeout=DEADLINE_S) as connection:
                    if turn % 2:
                        connection.sendall(b"\x20")
            self.check_alive()
            wait_until(lambda most=before + 2: self.descriptors() <= most, "the descriptors to be closed", DEADLINE_S)

    def test_a_service_request_that_announces_too_much_is_refused_with_the_reason(self):
        for announced in (LIMIT_BYTES + 1, 10**9, 2**32 - 1):
            client = self.handshake(service="/serve")
            client.sendall(struct.pack("<I", announced) + b"\x01")
            answer = b""
            with contextlib.suppress(ConnectionResetError):
                while portion := client.recv(4096):
                    answer += portion
            self.assertIn(b"a message of %d bytes is announced, at most %d" % (announced, LIMIT_BYTES), answer)
        self.check_alive()

    def test_a_request_may_come_some_time_after_its_connection(self):
        client = self.handshake(service="/serve")
        begin = time.monotonic()
        wait_until(lambda: time.monotonic() > begin + 0.5, "half a second without a request", DEADLINE_S)
        client.sendall(struct.pack("<I?", 1, True))
        stream = client.makefile("rb")
        stream.read(*struct.unpack("<I", stream.read(4)))
        self.assertEqual(stream.read(1), b"\1")
        self.assertIn(b"served", stream.read())

    def test_a_request_that_cannot_be_read_is_answered_with_an_error_and_the_connection_closed(self):
        level = rosgraph.names.ns_join(NODE, "set_logger_level")
        for service, requests in (("/serve", [b""]), (level, [b"", b"\x01", struct.pack("<I", 2**31), b"\xff" * 12])):
            for request in requests:
                for persistent in "01":
                    client = self.handshake(service=service, persistent=persistent)
                    client.sendall(struct.pack("<I", len(request)) + request)
                    stream = client.makefile("rb")
                    header_bytes, = struct.unpack("<I", stream.read(4))
                    stream.read(header_bytes)
                    # Up to the end of the connection.
                    answer = stream.read()
                    self.assertEqual(answer[:1], b"\0", (service, request, answer))
                    length, = struct.unpack("<I", answer[1:5])
                    self.assertEqual(len(answer), 5 + length)
                    self.assertIn(b"request refused", answer)
        self.check_alive()

    def test_an_answer_that_cannot_be_sent_spoils_none_of_those_after_it(self):
        for persistent in (False, True):
            half = rospy.ServiceProxy("half", SetBool, persistent=persistent)
            self.addCleanup(half.close)
            for _ in range(3):
                with self.assertRaisesRegex(rospy.ServiceException, "error processing request"):
                    half(True)
                answer = half(False)
                self.assertEqual((answer.success, answer.message), (True, "whole"))

    def test_a_message_that_announces_too_much_ends_its_connection_with_one_line(self):
        publisher = rospy.Publisher("large", String, queue_size=None)
        wait_until(publisher.get_num_connections, "the node to connect", DEADLINE_S)
        connection = publisher.impl.connections[0].socket
        connection.sendall(struct.pack("<I", 10**9) + b"\x01\x02")
        wait_until(lambda: is_closed(connection), "the node to close the connection", DEADLINE_S)
        publisher.unregister()
        parts = ("large", rospy.get_name(), "1000000000", str(LIMIT_BYTES), "~largest_message_bytes")
        wait_until(lambda: self.said(*parts), "the line about it", DEADLINE_S)
        self.assertEqual(len(self.said(*parts)), 1)
        self.check_heard("large")


def is_closed(connection):
    try:
        return connection.recv(1, socket.MSG_DONTWAIT) == b""
    except BlockingIOError:
        return False
    except OSError:
        return True


if __name__ == "__main__":
    rospy.init_node("limits_test")
    rostest.rosrun("rospy_nodes", "limits", RospyLimits)
