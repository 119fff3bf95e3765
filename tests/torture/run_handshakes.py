# SPDX-License-Identifier: BSD-3-Clause
"""torture.py handshakes: hostile bytes on the ports of one node in this process, which has no master and no simulator.

After each batch the node must still serve a subscriber, a request, a call and a publisher, and no thread may have met
an error that nobody foresaw.
"""
import contextlib
import logging
import random
import socket
import struct
import threading
import time
import xmlrpc.client

import rosgraph.xmlrpc
import rospy
from handshakes import HEARD, MD5SUMS, SERVICE, TOPIC, drawn
from rospy.impl import masterslave, tcpros, tcpros_base, tcpros_service
from rospy.topics import _PublisherImpl, _SubscriberImpl
from std_msgs.msg import String
from std_srvs.srv import SetBool, SetBoolResponse
from tcpros import ServiceConnection, handshake, header

from lab_testing.waiting import wait_until
from rospy_nodes.start import limit_ports

BATCH = 500
DEADLINE_S = 60.0
# Threads that a batch may leave for a moment: of connections that wait for the deadline of their request.
MAX_THREADS = 800


class Node:
    """The ports of a rospy node, without a master."""

    def __init__(self):
        logging.disable(logging.CRITICAL)  # of all that rospy says about each input
        self.faults = limit_ports(publishes=False)
        tcpros_base._use_tcp_keepalive = True  # else it asks the master
        tcpros.init_tcpros()
        tcpros_base.start_tcpros_server()
        self.tcpros = "127.0.0.1", tcpros_base.get_tcpros_server_address()[1]
        manager = rospy.topics.get_topic_manager()
        manager.pubs[TOPIC] = _PublisherImpl(TOPIC, String)
        self._heard, self._subscription = [], _SubscriberImpl(HEARD, String)
        self._subscription.add_callback(lambda message: self._heard.append(message.data), None)
        manager.subs[HEARD] = self._subscription
        tcpros_service.get_service_manager().map[SERVICE] = tcpros_service.ServiceImpl(
            SERVICE, SetBool, lambda request: SetBoolResponse(request.data, "served"))
        self._node = rosgraph.xmlrpc.XmlRpcNode(0, masterslave.ROSHandler("/fuzzed", None))
        self._node.start()
        wait_until(lambda: self._node.uri, "the XML-RPC server", DEADLINE_S)
        self.xmlrpc = "127.0.0.1", self._node.port
        self._publisher = socket.create_server(("127.0.0.1", 0), backlog=64)
        self._publisher.settimeout(DEADLINE_S)

    def send(self, kind, data, stays):
        """Send an input; returns the connection if it stays open."""
        if kind == "publisher":
            connection = self._asked()
        else:
            connection = socket.create_connection(self.xmlrpc if kind == "xmlrpc" else self.tcpros, DEADLINE_S)
        with contextlib.suppress(OSError):
            connection.sendall(data)
        if stays:
            return connection
        connection.close()
        return None

    def _asked(self):
        """The connection of the node's subscription to a publisher."""
        port = self._publisher.getsockname()[1]
        answer = tcpros.get_tcpros_handler().create_transport(HEARD, "http://127.0.0.1:1/%f" % time.monotonic(),
                                                              ["TCPROS", "127.0.0.1", port])
        assert answer[0] == 1, answer
        connection, _ = self._publisher.accept()
        return connection

    def problems(self):
        """Flaws of the node: a list of texts."""
        found = []
        for what, check in (("subscriber", self._subscribes), ("request", self._answers), ("call", self._calls),
                            ("publisher", self._hears)):
            try:
                check()
            except (OSError, AssertionError, xmlrpc.client.Error, Exception) as error:  # noqa: BLE001  (any is one)
                found.append("a good %s fails: %s: %s" % (what, type(error).__name__, error))
        if (faults := self.faults.summary()) is not None:
            found.append("%s %s" % faults)
        if threading.active_count() > MAX_THREADS:
            found.append("%d threads" % threading.active_count())
        return found

    def _subscribes(self):
        fields = {"callerid": "/good", "topic": TOPIC, "md5sum": MD5SUMS["topic"], "type": "std_msgs/String"}
        connection, answer = handshake(self.tcpros, fields, DEADLINE_S)
        connection.close()
        assert answer.get("type") == "std_msgs/String", answer

    def _answers(self):
        connection = ServiceConnection(self.tcpros, SERVICE, MD5SUMS["service"])
        with contextlib.closing(connection):
            is_fine, answer = connection.call(b"\x01", DEADLINE_S)
            assert is_fine and b"served" in answer, answer

    def _calls(self):
        with xmlrpc.client.ServerProxy("http://%s:%d/" % self.xmlrpc) as proxy:
            code, text, _ = proxy.getPid("/good")
        assert code == 1, text

    def _hears(self):
        word = "%f" % time.monotonic()
        with contextlib.closing(self._asked()) as connection:
            data = word.encode()
            connection.sendall(header({"callerid": "/good", "md5sum": MD5SUMS["topic"], "type": "std_msgs/String",
                                       "topic": HEARD, "latching": "0"})
                               + struct.pack("<II", 4 + len(data), len(data)) + data)
            wait_until(lambda: word in self._heard, "a good publisher's message", DEADLINE_S)
        self._heard.clear()


def run(options, journal):
    """Send the inputs; return figures for the result."""
    node, began, kinds = Node(), time.monotonic(), {}
    last = options.first + options.messages
    for first in range(options.first, last, BATCH):
        if options.until is not None and time.monotonic() > options.until:
            break
        count = min(BATCH, last - first)
        with contextlib.ExitStack() as idle:
            for index in range(first, first + count):
                choose = random.Random("%d/%d" % (options.seed, index))
                kind, data = drawn(choose)
                kinds[kind] = kinds.get(kind, 0) + 1
                journal.note(index, kind, "hostile", data)
                connection = node.send(kind, data, stays=choose.random() < 0.1)
                if connection is not None:
                    idle.enter_context(contextlib.closing(connection))
            problems = node.problems()
        if problems:
            journal.fail("; ".join(problems), options.seed, first, count)
            break
    return {"also": {"inputs_of_each_kind": kinds, "seconds": round(time.monotonic() - began, 1)}}
