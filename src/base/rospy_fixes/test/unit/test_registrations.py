# SPDX-License-Identifier: BSD-3-Clause
"""Registrations with a master that refuses, does not answer, or comes back."""
import contextlib
import importlib.util
import socket
import threading
from types import SimpleNamespace
from xmlrpc.server import SimpleXMLRPCServer

import pytest

from lab_testing.waiting import wait_until
from processes.ports import free_port
from rospy_fixes import registrations


class Master:
    """A ROS master that notes its calls. Until ``answers`` is set, it takes connections and says nothing."""

    def __init__(self, port=0):
        self.calls, self.answers = [], threading.Event()
        self.answers.set()
        self.listener = SimpleXMLRPCServer(("127.0.0.1", port), logRequests=False)
        self.uri = "http://127.0.0.1:%d" % self.listener.server_address[1]
        for method in ("registerPublisher", "registerSubscriber", "registerService", "unregisterPublisher",
                       "unregisterSubscriber", "unregisterService"):
            self.listener.register_function(self._noting(method), method)
        self._is_closed, self._serving = False, threading.Thread(target=self._serve, daemon=True)
        self._serving.start()

    def _noting(self, method):
        def note(caller, name, data, *rest):
            self.calls.append((method, name))
            return 1, "", ["http://talker"] if method == "registerSubscriber" else 1
        return note

    def _serve(self):
        with contextlib.suppress(OSError, ValueError):
            while not self._is_closed:
                self.answers.wait()
                self.listener.handle_request()

    def close(self):
        self._is_closed = True
        self.answers.set()
        socket.create_connection(self.listener.server_address).close()  # the one that it waits for
        self._serving.join(30.0)
        self.listener.server_close()

    def names(self, method="registerPublisher"):
        return [name for called, name in self.calls if called == method]


@pytest.fixture
def master():
    master = Master()
    yield master
    master.close()


@pytest.fixture
def node(master, monkeypatch):
    """rospy's registration manager of a node, amended; ``lines``: its log; ``updates``: publishers that it heard of."""
    spec = importlib.util.find_spec("rospy.impl.registration")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)  # one of its own: the lab's environment may have amended rospy's
    if not hasattr(module.RegManager.reg_added, "__wrapped__"):
        registrations.amend(module)
    node = module.RegManager(SimpleNamespace(done=False))
    node.master_uri, node.uri, node.lines, node.ended = master.uri, "http://me", [], threading.Event()
    node.on_rosout = []
    module.logerr = lambda text, *words: [told.append(text % words) for told in (node.lines, node.on_rosout)]
    monkeypatch.setattr(node.logger, "error", node.lines.append)
    module.is_shutdown = node.ended.is_set
    node.publish = lambda name: node.reg_added(name, "std_msgs/Bool", module.Registration.PUB)
    node.withdraw = lambda name: node.reg_removed(name, "std_msgs/Bool", module.Registration.PUB)
    node.subscribe = lambda name: node.reg_added(name, "std_msgs/Bool", module.Registration.SUB)
    monkeypatch.setattr(registrations, "DEADLINE_S", 0.2)
    monkeypatch.setattr(registrations, "ANSWER_S", 0.5)
    monkeypatch.setattr(registrations, "RETRY_S", 0.01)
    yield node
    node.ended.set()


@pytest.mark.parametrize("name", ["/a\x01b", "/a\0", "/\ud800"])
def test_a_name_that_the_master_cannot_read_is_refused_with_a_line_and_the_next_one_comes_through(node, master, name):
    node.publish(name)
    node.publish("/after")
    assert master.names() == ["/after"]
    line, = node.lines
    assert ascii(name)[1:-1] in line and line.isprintable()


def test_a_master_that_says_nothing_gets_all_of_them_when_it_answers_again(node, master):
    node.publish("/rosout")
    master.answers.clear()
    with socket.create_connection(master.listener.server_address):  # the request that it waits in
        for name in ("/one", "/two", "/three", "/gone"):
            node.publish(name)
        node.withdraw("/gone")
        node.subscribe("/heard")
        assert any("/one" in line and master.uri in line for line in node.lines)
        assert not set(master.names()) & {"/two", "/three"}
        assert not node.on_rosout  # rospy would ask the master for a parameter first
        master.answers.set()
    wait_until(lambda: {"/one", "/two", "/three"} <= set(master.names()), "the late registrations")
    wait_until(lambda: ("/heard", ["http://talker"]) in node.updates, "the publishers of the late subscription")
    assert "/gone" not in master.names()


def test_a_node_that_starts_before_its_master_waits_for_it(node, monkeypatch):
    monkeypatch.setattr(registrations, "DEADLINE_S", 0.0)
    port = free_port()
    node.master_uri = "http://127.0.0.1:%d" % port
    starting = threading.Thread(target=node.publish, args=["/rosout"], daemon=True)
    starting.start()
    wait_until(lambda: node.lines, "a line about the master")
    starting.join(0.2)
    assert starting.is_alive() and len(node.lines) == 1 and node.master_uri in node.lines[0]
    late = Master(port)
    starting.join(30.0)
    assert late.names() == ["/rosout"] and not starting.is_alive()
    late.close()


def test_a_master_that_is_gone_is_tried_until_it_is_back(node):
    port = free_port()
    before = Master(port)
    node.master_uri = before.uri
    node.publish("/rosout")
    before.close()
    node.publish("/early")
    assert any("/early" in line for line in node.lines)
    again = Master(port)
    wait_until(lambda: "/early" in again.names(), "the registration")
    again.close()


def test_what_is_registered_is_withdrawn(node, master):
    node.publish("/talk")
    node.withdraw("/talk")
    assert master.calls == [("registerPublisher", "/talk"), ("unregisterPublisher", "/talk")]


def test_a_node_ends_beside_a_master_that_says_nothing(node, master):
    master.answers.clear()
    node.publish("/talk")  # the master still answers the one that it waits for
    ending = threading.Thread(target=node.cleanup, args=("end",), daemon=True)
    ending.start()
    wait_until(lambda: not ending.is_alive(), "the end")
    assert any("does not answer: it still lists it" in line for line in node.lines)


def test_a_subscriber_does_not_ask_a_silent_master_for_its_statistics(node, master, monkeypatch):
    statistics = SimpleNamespace(SubscriberStatisticsLogger=type("Logger", (), {}))
    registrations.amend(statistics)
    is_enabled = statistics.SubscriberStatisticsLogger.is_enabled
    monkeypatch.setenv("ROS_MASTER_URI", master.uri)
    asked = []
    master.listener.register_function(lambda caller, name: asked.append(name) or (1, "", True), "getParam")
    node.publish("/rosout")
    assert is_enabled() and asked == ["/enable_statistics"]
    master.answers.clear()
    with socket.create_connection(master.listener.server_address):  # the request that it waits in
        node.publish("/talk")
        assert not is_enabled()
    master.answers.set()
    wait_until(lambda: "/talk" in master.names(), "the late registration")
    wait_until(is_enabled, "statistics again")
    assert set(asked) == {"/enable_statistics"}
