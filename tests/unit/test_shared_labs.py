# SPDX-License-Identifier: BSD-3-Clause
"""Files that share a lab: which ones do, what they become, and what a test may not leave behind."""
import json
import os
from pathlib import Path
from xml.etree import ElementTree

import pytest

from lab_testing.lab_state import LabState, differences, flattened
from lab_tests import rostests, shared_labs

LAUNCH = """<!-- shared lab -->
<launch>{lab}
  <test test-name="{name}" pkg="my_lab" type="{name}.py" time-limit="20" args="--quick">{inside}</test>
</launch>"""


def write(folder, name, lab="<param name='speed' value='2'/>", inside=""):
    path = folder / f"{name}.test"
    path.write_text(LAUNCH.format(name=name, lab=lab, inside=inside))
    return path


def test_files_share_a_lab_that_is_written_the_same(tmp_path):
    lab = shared_labs.lab_of(write(tmp_path, "one"))
    assert lab == shared_labs.lab_of(write(tmp_path, "two", "<!-- fast -->\n  <param  name='speed' value='2' />"))
    others = ["<param name='speed' value='3'/>", "<!-- beside others --><param name='speed' value='2'/>",
              "<!-- real time --><param name='speed' value='2'/>", ""]
    found = [shared_labs.lab_of(write(tmp_path, f"other{number}", other)) for number, other in enumerate(others)]
    assert lab not in found
    alone = write(tmp_path, "alone")
    alone.write_text(alone.read_text().replace("shared lab", "alone"))
    assert shared_labs.lab_of(alone) is None


def test_shared_files_become_one_test_with_their_parameters(tmp_path):
    paths = [write(tmp_path, "one", inside="<param name='goal' value='left'/>"), write(tmp_path, "two")]
    launch, results = shared_labs.write(paths, tmp_path)
    root = ElementTree.parse(launch).getroot()
    assert [test.get("type") for test in root.findall("test")] == ["shared_lab"]
    assert root.find("group[@ns='one']/param").attrib == {"name": "goal", "value": "left"}
    assert root.find("param").get("name") == "speed"
    plan = json.loads((tmp_path / "plan.json").read_text())
    assert [member["results"] for member in plan] == [str(result) for result in results]
    assert plan[0]["tests"] == [{"name": "one", "package": "my_lab", "type": "one.py", "arguments": ["--quick"],
                                 "time_limit_s": 20.0}]


def test_a_test_that_needs_more_than_parameters_is_named(tmp_path):
    with pytest.raises(ValueError, match=r"one\.test.*remap"):
        shared_labs.write([write(tmp_path, "one", inside="<remap from='a' to='b'/>")], tmp_path)


FIRST = LabState(frozenset({"publisher /clock: /gazebo"}), {"/speed": 2}, frozenset({"baxter"}),
                 frozenset({"arm: running"}), frozenset(), {"left_s0": 0.0}, enabled=False)


@pytest.mark.parametrize(("change", "line"), [
    ({"graph": FIRST.graph | {"subscriber /clock: /watcher"}}, "/watcher"),
    ({"graph": frozenset()}, "/gazebo"),
    ({"parameters": {"/speed": 3}}, "/speed"),
    ({"parameters": {}}, "/speed"),
    ({"models": frozenset({"baxter", "cube"})}, "cube"),
    ({"controllers": frozenset({"arm: stopped"})}, "arm: stopped"),
    ({"scene": frozenset({"object table"})}, "table"),
    ({"joints": {"left_s0": 0.5}}, "left_s0"),
    ({"joints": {}}, "left_s0"),
    ({"enabled": True}, "enabled"),
])
def test_each_thing_left_behind_is_named(change, line):
    assert any(line in found for found in differences(FIRST, LabState(**{**vars(FIRST), **change})))


def test_connections_of_the_labs_own_nodes_and_small_motions_are_nothing_left():
    now = {"graph": FIRST.graph | {"subscriber /tf: /gazebo"}, "joints": {"left_s0": 0.001, "head_pan": 1.0}}
    assert differences(FIRST, LabState(**{**vars(FIRST), **now})) == []


def test_parameters_are_compared_leaf_by_leaf():
    assert dict(flattened({"a": {"b": 1, "c": [1, 2]}, "d": {}})) == {"/a/b": 1, "/a/c": [1, 2]}


PROGRAM = """#!/usr/bin/env python3
import os, subprocess, unittest
import rosgraph, rospy, rostest


def stay():
    rospy.set_param("/speed", 3)
    rosgraph.Master("/stranger").registerSubscriber("/never", "std_msgs/Bool", "http://localhost:1")


class T(unittest.TestCase):
    def test_lab(self):
        self.assertEqual(rospy.get_param("/speed"), 2)
        self.assertEqual(rospy.get_param("~goal"), rospy.get_name())
        open(os.environ["SHARED_LABS"], "a").write("%%s %%s\\n" %% (rospy.get_param("/run_id"), rospy.get_name()))
        %s


rospy.init_node("any")
rostest.rosrun("my_lab", "any", T)
"""


def test_a_file_that_leaves_something_fails_and_the_next_one_gets_a_new_lab(tmp_path, monkeypatch):
    package = tmp_path / "my_lab"
    package.mkdir()
    (package / "package.xml").write_text("<package format='3'><name>my_lab</name></package>")
    monkeypatch.setenv("ROS_PACKAGE_PATH", f"{tmp_path}:{os.environ['ROS_PACKAGE_PATH']}")
    monkeypatch.setenv("SHARED_LABS", str(tmp_path / "labs"))
    monkeypatch.setenv("LC_ALL", "C")
    ends = {"clean": "pass", "dirty": "stay()", "wrong": "self.fail('on purpose')",
            "parent": "subprocess.Popen(['sleep', '600'], start_new_session=True)", "last": "pass"}
    paths = []
    for name, end in ends.items():
        program = package / f"{name}.py"
        program.write_text(PROGRAM % end)
        program.chmod(0o755)
        paths.append(write(package, name, inside=f"<param name='goal' value='/{name}'/>"))
    tallies = rostests.run_shared(paths, tmp_path / "work", dict(os.environ))
    assert {path.stem: (tally.passed, tally.failed) for path, tally in tallies.items()} == {
        "clean": (2, 0), "dirty": (1, 1), "wrong": (1, 1), "parent": (2, 1), "last": (1, 0)}
    assert "/never" in tallies[paths[1]].details[0] and "sleep 600" in str(tallies[paths[3]].details)
    labs = [line.split() for line in Path(tmp_path, "labs").read_text().splitlines()]
    assert [name for _, name in labs] == [f"/{name}" for name in ends]
    assert labs[0][0] == labs[1][0] != labs[2][0] == labs[3][0]
