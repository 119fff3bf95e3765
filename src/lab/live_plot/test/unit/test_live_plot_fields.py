# SPDX-License-Identifier: BSD-3-Clause
"""From users' input to numbers of messages: syntax, topics, fields, arrays, times, and all errors."""
import subprocess
import sys
from types import SimpleNamespace

import pytest

from live_plot.fields import PlotError, UnknownTopic, curves, expand, split

TYPES = {
    "sensor_msgs/JointState": {"header": "std_msgs/Header", "name": "string[]", "position": "float64[]"},
    "std_msgs/Header": {"seq": "uint32", "stamp": "time", "frame_id": "string"},
    "geometry_msgs/PoseWithCovariance": {"pose": "geometry_msgs/Pose", "covariance": "float64[36]"},
    "geometry_msgs/Pose": {"position": "geometry_msgs/Point", "orientation": "geometry_msgs/Quaternion"},
    "geometry_msgs/Point": {"x": "float64", "y": "float64", "z": "float64"},
    "geometry_msgs/PoseArray": {"header": "std_msgs/Header", "poses": "geometry_msgs/Pose[]"},
    "std_msgs/String": {"data": "string"},
    "rosgraph_msgs/Clock": {"clock": "time"},
}
JOINTS = "sensor_msgs/JointState"


def labels(type_name, *tokens):
    return [curve.label for curve in curves("/t", tokens, type_name, TYPES.__getitem__)]


@pytest.mark.parametrize("argument, paths", [
    ("/probot_anno/joint_states/position[0]", ["/probot_anno/joint_states/position[0]"]),
    ("/a/b:c:d", ["/a/b", "/a/c", "/a/d"]),
    ("/a/p/x:y,/b/data", ["/a/p/x", "/a/p/y", "/b/data"]),
    ("a/b", ["/a/b"]),
    ("/js/position[0]:position[5]:velocity[0]", ["/js/position[0]", "/js/position[5]", "/js/velocity[0]"]),
    ("/a/b, /a/c/", ["/a/b", "/a/c"])])
def test_arguments_name_paths(argument, paths):
    assert expand(argument) == paths


@pytest.mark.parametrize("argument", [
    "", ",", "/", "/a//b", "/a/b[", "/a/b[x]", "/a/b[-1]", "/a/b::c", "/a/b:", "/a/b c", "/a/b[1][2]"])
def test_other_arguments_are_refused_with_the_form_that_is_right(argument):
    with pytest.raises(PlotError, match="/topic/field"):
        expand(argument)


def test_longest_topic_wins():
    topics = {"/a", "/a/b", "/a/bc"}
    assert split("/a/b/x", topics) == ("/a/b", ["x"])
    assert split("/a/bc", topics) == ("/a/bc", [])
    assert split("/a/position[0]", topics) == ("/a", ["position[0]"])


def test_missing_topic_is_named_with_similar_ones():
    with pytest.raises(UnknownTopic, match=r"'/joint_state/position\[0\]'.*similar names: /robot/joint_states"):
        split("/joint_state/position[0]", {"/robot/joint_states", "/clock"})
    with pytest.raises(UnknownTopic, match="rostopic list"):
        split("/x", set())


def test_element_of_an_array():
    (curve,) = curves("/t", ["position[1]"], JOINTS, TYPES.__getitem__)
    assert curve.label == "/t/position[1]"
    assert curve.value(SimpleNamespace(position=(0.5, 1.5))) == 1.5
    with pytest.raises(PlotError, match=r"/t/position\[1\]: the array has 1 element"):
        curve.value(SimpleNamespace(position=(0.5,)))


def test_field_within_messages_and_arrays_of_messages():
    (curve,) = curves("/t", ["poses[0]", "position", "y"], "geometry_msgs/PoseArray", TYPES.__getitem__)
    pose = SimpleNamespace(position=SimpleNamespace(x=1.0, y=2.0, z=3.0))
    assert curve.value(SimpleNamespace(poses=[pose])) == 2.0


def test_message_stands_for_its_numbers():
    assert labels("geometry_msgs/Pose", "position") == ["/t/position/x", "/t/position/y", "/t/position/z"]
    assert labels(JOINTS, "header") == ["/t/header/seq", "/t/header/stamp"]


def test_times_are_seconds_and_have_parts():
    (curve,) = curves("/t", ["clock"], "rosgraph_msgs/Clock", TYPES.__getitem__)
    assert curve.value(SimpleNamespace(clock=SimpleNamespace(to_sec=lambda: 2.5))) == 2.5
    assert labels("rosgraph_msgs/Clock", "clock", "nsecs") == ["/t/clock/nsecs"]


@pytest.mark.parametrize("type_name, tokens, text", [
    (JOINTS, ["posit"], r"/t \(sensor_msgs/JointState\) has no field 'posit'; it has header .*position \(float64\["),
    (JOINTS, ["position"], r"/t/position is an array \(float64\[\]\): choose an element, as in /t/position\[0\]"),
    (JOINTS, ["name[0]"], r"/t/name\[0\] \(string\) is not a number; only numbers can be plotted"),
    (JOINTS, ["header", "stamp", "hours"], r"/t/header/stamp \(time\) has no field 'hours'; it has secs .*nsecs"),
    (JOINTS, ["position[0]", "x"], r"/t/position\[0\] is one float64 and has no field 'x'"),
    ("std_msgs/String", [], r"/t \(std_msgs/String\) is not a number; it has data \(string\)"),
    ("geometry_msgs/Point", ["x[0]"], r"/t/x\[0\]: this field is not an array but one float64"),
    ("geometry_msgs/PoseWithCovariance", ["covariance[36]"], r"the array has 36 elements, counted from 0"),
    ("geometry_msgs/PoseWithCovariance", ["pose"], r"is not a number; it has position \(geometry_msgs/Point\)")])
def test_wrong_field_is_answered_with_the_fields(type_name, tokens, text):
    with pytest.raises(PlotError, match=text):
        labels(type_name, *tokens)


def test_core_loads_without_ros_and_qt():
    block = "import sys; sys.modules.update(dict.fromkeys(%r)); " % (
        ["rospy", "roslib", "genpy", "rosgraph", "pyqtgraph", "PyQt5"],)
    subprocess.run([sys.executable, "-c", block + "import live_plot.fields, live_plot.recording"], check=True)
