# SPDX-License-Identifier: BSD-3-Clause
"""The calls that a program may make at the master of the judge's lab, and those refused. The master is a real one."""
import pytest
from rosmaster.master import Master

import master_calls
from processes.ports import free_port
from rf_checks import graph as graph_module
from rf_checks.graph import JudgedGraph, LabFailed, flat

PARAMETERS = {"use_sim_time": True, "gazebo": {"pose": "neutral", "none": {}}}


class Node:
    """The requests of a node of that name to a master."""

    def __init__(self, name, uri):
        self.master = master_calls.master(name, uri, 10.0)
        self._uri, self._rosrpc = "http://127.0.0.1:1" + name, "rosrpc://127.0.0.1:1" + name

    def publish(self, topic):
        self.master.registerPublisher(topic, "std_msgs/Empty", self._uri)

    def unpublish(self, topic):
        self.master.unregisterPublisher(topic, self._uri)

    def hear(self, topic):
        self.master.registerSubscriber(topic, "std_msgs/Empty", self._uri)

    def unhear(self, topic):
        self.master.unregisterSubscriber(topic, self._uri)

    def serve(self, name):
        self.master.registerService(name, self._rosrpc, self._uri)

    def unserve(self, name):
        self.master.unregisterService(name, self._rosrpc)


@pytest.fixture
def uri():
    """Of a ROS master, in threads of this process."""
    master = Master(port=free_port())
    master.start()
    yield master.uri
    master.stop()


@pytest.fixture
def me(uri):
    return Node("/me", uri)


@pytest.fixture
def ik(uri):
    """A node of the lab's; beside it there is /gazebo."""
    gazebo, ik = Node("/gazebo", uri), Node("/ik", uri)
    gazebo.publish("/clock")
    gazebo.publish("/rosout")
    ik.publish("/rosout")
    ik.publish("/report")
    ik.hear("/clock")
    ik.serve("/solve")
    gazebo.master.setParam("/", PARAMETERS)
    return ik


@pytest.fixture
def living():
    """Nodes whose processes live."""
    return {"/gazebo", "/ik"}


@pytest.fixture
def graph(ik, uri, living):
    graph = JudgedGraph(uri)
    graph.remember({node: lambda node=node: node in living for node in ("/gazebo", "/ik")})
    return graph


def test_what_a_program_has_itself_is_no_change(graph, me):
    assert graph.is_as_it_was()
    me.publish("/mine")
    me.publish("/rosout")
    me.hear("/clock")
    me.serve("/me/loggers")
    me.master.setParam("/mine/a", 1)
    assert not graph.changes(with_parameters=True)
    # The next program must find none of it.
    assert not graph.is_as_it_was()
    graph.forget_strangers()
    assert graph.nodes() == {"/gazebo", "/ik"}
    assert not me.master.hasParam("/mine/a")


def test_who_else_publishes_the_labs_topics_is_an_intruder(graph, me):
    me.publish("/clock")
    assert graph.changes()
    assert graph.changes().intruders == {"/clock": ["/me"]}


def test_who_commands_an_arm_beside_a_node_of_the_lab_is_none(uri, me):
    servo = Node("/servo", uri)
    servo.publish("/robot/limb/left/joint_command")
    graph = JudgedGraph(uri)
    graph.remember({})
    me.publish("/robot/limb/left/joint_command")
    assert not graph.changes()


def test_a_node_that_is_gone_is_missing(graph, ik):
    ik.unpublish("/rosout")
    ik.unpublish("/report")
    ik.unhear("/clock")
    ik.unserve("/solve")
    assert graph.changes().missing_nodes == ["/ik"]
    assert graph.changes().withdrawn == []


def test_a_node_whose_process_ended_is_missing_though_another_has_its_name(graph, living):
    living.discard("/ik")
    assert graph.changes().missing_nodes == ["/ik"]
    assert not graph.is_as_it_was()


def test_a_node_that_is_about_to_end_is_missing(graph, ik, living):
    ik.unhear("/clock")
    lives = iter((True, True, True))
    graph._processes["/ik"] = lambda: next(lives, False)
    assert graph.changes().missing_nodes == ["/ik"]
    assert graph.changes().withdrawn == []


@pytest.mark.parametrize(("take_back", "name"), [("unpublish", "/report"), ("unhear", "/clock"), ("unserve", "/solve")])
def test_a_registration_that_somebody_takes_back_is_missed(graph, ik, me, take_back, name, monkeypatch):
    monkeypatch.setattr(graph_module, "_END_S", 0.05)
    getattr(ik, take_back)(name)
    if take_back == "unserve":
        me.serve(name)  # in its place
    assert graph.changes().withdrawn == [name]


@pytest.mark.parametrize("change", [lambda master: master.setParam("/use_sim_time", False),
                                    lambda master: master.deleteParam("/use_sim_time")], ids=["set", "deleted"])
def test_a_parameter_that_is_changed_or_deleted_is_told(graph, me, change):
    change(me.master)
    assert not graph.changes()
    assert graph.changes(with_parameters=True).parameters == ["/use_sim_time"]
    assert not graph.is_as_it_was()


def test_a_branch_of_parameters_in_the_place_of_a_value_is_told(graph, me):
    me.master.setParam("/gazebo/pose", {"x": 1})
    assert graph.changes(with_parameters=True).parameters == ["/gazebo/pose"]


def test_a_master_that_is_gone_is_named():
    with pytest.raises(LabFailed, match="the ROS master is gone"):
        JudgedGraph("http://127.0.0.1:%d" % free_port()).nodes()


def test_parameters_have_one_name_each():
    assert flat({"a": {"b": [1, 2], "c": {}}, "d": ""}) == {"/a/b": [1, 2], "/a/c": {}, "/d": ""}
