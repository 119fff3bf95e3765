# SPDX-License-Identifier: BSD-3-Clause
import roslib.message
from sensor_msgs.msg import Image, JointState, PointField
from std_srvs.srv import EmptyRequest

from rosapi import queries
from rosapi.typedefs import definitions

STATE = ([["/a", ["/n1"]], ["/act/goal", ["/n2"]], ["/act/cancel", ["/n2"]]],
         [["/a", ["/n2", "/n1"]], ["/act/status", ["/n2"]], ["/act/feedback", ["/n2"]], ["/act/result", ["/n2"]]],
         [["/n1/reset", ["/n1"]]])


def described(cls):
    return {one.type: one for one in definitions(cls, roslib.message.get_message_class)}


def test_a_type_is_described_with_the_types_in_it():
    found = described(JointState)
    assert list(found) == ["sensor_msgs/JointState", "std_msgs/Header", "time"]
    joints = found["sensor_msgs/JointState"]
    assert joints.fieldnames == ["header", "name", "position", "velocity", "effort"]
    assert joints.fieldtypes == ["std_msgs/Header", "string", "float64", "float64", "float64"]
    assert joints.fieldarraylen == [-1, 0, 0, 0, 0] and joints.examples == ["{}", "[]", "[]", "[]", "[]"]
    assert found["std_msgs/Header"].examples == ["0", "{}", ""]


def test_constants_and_types_without_fields():
    found = described(PointField)["sensor_msgs/PointField"]
    assert dict(zip(found.constnames, found.constvalues, strict=True))["FLOAT32"] == "7"
    assert described(EmptyRequest)["std_srvs/EmptyRequest"].fieldnames == []
    assert described(Image)["sensor_msgs/Image"].fieldarraylen[-1] == 0


def test_answers_from_the_masters_state():
    assert queries.topics(STATE) == {"/a", "/act/goal", "/act/cancel", "/act/status", "/act/feedback", "/act/result"}
    assert queries.nodes(STATE) == ["/n1", "/n2"]
    assert queries.of_node(STATE, "/n1") == (["/a"], ["/a"], ["/n1/reset"])
    assert (queries.publishers(STATE, "/a"), queries.subscribers(STATE, "/a")) == (["/n1"], ["/n1", "/n2"])
    assert (queries.publishers(STATE, "/x"), queries.providers(STATE, "/n1/reset")) == ([], ["/n1"])


def test_an_action_server_has_all_five_topics():
    assert queries.action_servers(queries.topics(STATE)) == ["/act"]
    assert queries.action_servers(queries.topics(STATE) - {"/act/status"}) == []


def test_patterns_leave_out_other_names():
    assert queries.allowed({"/b", "/a/x", "/a/y"}, ("/a/*",)) == ["/a/x", "/a/y"]
    assert queries.allowed(["/b", "/a", "/b"], ()) == ["/a", "/b"]


def test_values_that_json_does_not_have():
    assert queries.finite({"a": [1, float("nan"), 2.5], "b": float("inf"), "c": "x"}) == {
        "a": [1, None, 2.5], "b": None, "c": "x"}
