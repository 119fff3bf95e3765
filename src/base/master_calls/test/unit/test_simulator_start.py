# SPDX-License-Identifier: BSD-3-Clause
"""Which processes count as a starting simulator; master, roslaunch and nodes answer as ROS's own do."""
import socket
import threading
from xmlrpc.server import SimpleXMLRPCServer

import pytest

from master_calls.simulator_start import SPAWNING, SimulatorDied, StartWatch


class Server:
    """An XML-RPC server in a thread."""

    def __init__(self, **functions):
        self._server = SimpleXMLRPCServer(("127.0.0.1", 0), logRequests=False, allow_none=True)
        for name, function in functions.items():
            self._server.register_function(function, name)
        self.uri = "http://127.0.0.1:%d" % self._server.server_address[1]
        self._thread = threading.Thread(target=self._server.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True)
        self._thread.start()

    def close(self):
        self._server.shutdown()
        self._thread.join()
        self._server.server_close()


class FakeMaster:
    """Master and roslaunch; `nodes`: {name: address}, `published`: {topic: [node]}, `running`: names of processes."""

    def __init__(self):
        self.nodes, self.published, self.running = {}, {}, []
        self.launch = Server(list_processes=lambda: [1, "", [[[name, 1] for name in self.running], [["ended-9", 1]]]])
        self.parameters = {"/roslaunch/uris": {"host_here": self.launch.uri, "host_ended": dead_address()}}
        self.server = Server(getSystemState=self._state, getParam=self._parameter, lookupNode=self._node)
        self.uri = self.server.uri

    def register(self, name, address, *topics):
        self.nodes[name] = address
        for topic in ("/rosout", *topics):
            self.published.setdefault(topic, []).append(name)

    def unregister(self, name):
        del self.nodes[name]
        for nodes in self.published.values():
            if name in nodes:
                nodes.remove(name)

    def _state(self, caller):
        return [1, "", [[[topic, nodes] for topic, nodes in self.published.items() if nodes], [], []]]

    def _parameter(self, caller, name):
        return [1, "", self.parameters[name]] if name in self.parameters else [-1, "not set", 0]

    def _node(self, caller, name):
        return [1, "", self.nodes[name]] if name in self.nodes else [-1, "unknown node", ""]

    def close(self):
        self.server.close()
        self.launch.close()


def dead_address():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return "http://127.0.0.1:%d" % probe.getsockname()[1]


@pytest.fixture
def master():
    made = FakeMaster()
    yield made
    made.close()


@pytest.fixture
def node():
    made = Server(getPid=lambda caller: [1, "", 1])
    yield made.uri
    made.close()


def test_no_master_and_an_idle_one_are_no_start(master):
    assert StartWatch(dead_address()).look() == []
    assert StartWatch(master.uri).look() == []
    del master.parameters["/roslaunch/uris"]
    assert StartWatch(master.uri).look() == []


def test_each_step_of_a_start_is_seen_and_its_end_too(master, node):
    watch = StartWatch(master.uri)
    master.running = ["rosout-1", "gazebo-2", "urdf_spawner-5", "left/controller_spawner-6", "relay-7"]
    assert watch.look() == ["/gazebo", "/left/controller_spawner", "/urdf_spawner"]
    master.register("/gazebo", node)
    master.register("/left/controller_spawner", node)
    assert watch.look() == ["/gazebo", "/urdf_spawner"]
    master.register("/urdf_spawner", node, SPAWNING)
    master.published["/clock"] = ["/gazebo"]
    assert watch.look() == ["/urdf_spawner"]
    master.unregister("/urdf_spawner")
    master.running.remove("urdf_spawner-5")
    assert watch.look() == []


def test_what_died_without_signing_off_is_not_on_its_way(master):
    master.register("/gazebo", dead_address())
    master.register("/urdf_spawner", dead_address(), SPAWNING)
    assert StartWatch(master.uri).look() == []


@pytest.mark.parametrize("loss", ["dead", "unregistered", "master"])
def test_a_simulator_that_was_seen_and_is_gone_is_an_error(master, node, loss):
    watch = StartWatch(master.uri)
    master.register("/gazebo", node)
    assert watch.look() == ["/gazebo"]
    if loss == "dead":
        master.nodes["/gazebo"] = dead_address()
    elif loss == "unregistered":
        master.unregister("/gazebo")
    else:
        master.server.close()
        master.server.close = lambda: None
    with pytest.raises(SimulatorDied, match="start it again"):
        watch.look()


def test_an_answer_that_makes_no_sense_is_no_start(master):
    master.parameters["/roslaunch/uris"] = "nonsense"
    assert StartWatch(master.uri).look() == []
    strange = Server(list_processes=lambda: [1, "", 3], getSystemState=lambda caller: [0, "no", 0])
    master.parameters["/roslaunch/uris"] = {"a": strange.uri}
    assert StartWatch(master.uri).look() == []
    assert StartWatch(strange.uri).look() == []
    strange.close()
