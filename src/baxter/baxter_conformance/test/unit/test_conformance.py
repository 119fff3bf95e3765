# SPDX-License-Identifier: BSD-3-Clause
"""The comparison finds what is missing, of another type, silent or wrong, and counts only what programs can use."""
import math
from fnmatch import fnmatchcase
from types import SimpleNamespace

import pytest
from sensor_msgs.msg import JointState

from baxter_conformance import comparison, contents
from baxter_conformance.comparison import SeenInterface, Verdict, compare
from baxter_model import SIDES, joint_names
from baxter_model.interface import Interface, physical_robot


def complete():
    """Seen of a robot that has everything, but no messages were listened to."""
    robot = physical_robot()
    texts = {"text": "1.2.0.57", "names": ["left", "right"]}
    parameters = {name: texts[kind] for name, kind in robot.parameters.items()}
    parameters.update({"/robot_config/%s_config/joint_names" % side: list(joint_names(side)) for side in SIDES})
    return SeenInterface(published=dict(robot.published), listened=dict(robot.listened),
                         services={name: kind or "vendor/Secret" for name, kind in robot.services.items()},
                         parameters=parameters, frames={*robot.frames, "head"}, links=("base", "head"))


def only_finding(seen):
    """The one item that is not met."""
    wrong = [one for one in compare(physical_robot(), seen) if one.verdict is not Verdict.MET]
    assert len(wrong) == 1, wrong
    return wrong[0]


def test_a_complete_robot_meets_everything():
    findings = compare(physical_robot(), complete())
    assert {one.verdict for one in findings} == {Verdict.MET}
    assert comparison.report(findings)[-1].endswith("met (100.0 %)")


def test_what_nobody_can_use_is_counted_apart():
    seen = complete()
    del seen.published["/robot/joint_limits"], seen.services["/ExternalTools/left/PositionKinematicsNode/FKService"]
    findings = compare(physical_robot(), seen)
    met, total = comparison.totals(findings, True)
    assert met == total
    own_met, own = comparison.totals(findings, False)
    assert own_met == own - 2
    assert not any("joint_limits" in line for line in comparison.report(findings))


@pytest.mark.parametrize("table, name, group", [
    ("published", "/robot/state", "/robot"), ("published", "/robot/limb/left/endpoint_state", "/robot/limb"),
    ("listened", "/robot/limb/right/joint_command", "/robot/limb"), ("services", "/cameras/list", "services"),
    ("parameters", "/manifest/robot_serial", "parameters"),
])
def test_what_is_missing_is_named(table, name, group):
    seen = complete()
    del getattr(seen, table)[name]
    found = only_finding(seen)
    assert (found.group, found.name, found.verdict) == (group, name, Verdict.MISSING)
    lines = comparison.report(compare(physical_robot(), seen))
    assert any(line.startswith("  %s: " % name) for line in lines)
    met, total = comparison.scores(compare(physical_robot(), seen))[group]
    assert met == total - 1


def test_a_link_that_is_not_in_tf_is_missing():
    seen = complete()
    seen.links += ("left_hand",)
    assert only_finding(seen).name == "left_hand"


def test_direction_counts():
    """A program that publishes commands is not a robot that listens to them."""
    seen = complete()
    seen.published["/robot/set_super_stop"] = seen.listened.pop("/robot/set_super_stop")
    assert only_finding(seen).reason == "nobody listens to it"


def test_another_type_is_named_beside_the_expected_one():
    seen = complete()
    seen.published["/robot/state"] = "std_msgs/String"
    assert only_finding(seen).reason == "type std_msgs/String, not baxter_core_msgs/AssemblyState"
    seen = complete()
    seen.services["/cameras/open"] = "std_srvs/Empty"
    assert "baxter_core_msgs/OpenCamera" in only_finding(seen).reason


def test_an_unknown_type_is_no_fault():
    """The master does not know the type of a topic that only C++ nodes of an old kind listen to."""
    seen = complete()
    seen.listened["/robot/xdisplay"] = ""
    assert {one.verdict for one in compare(physical_robot(), seen)} == {Verdict.MET}


def test_a_service_that_does_not_answer_is_found():
    seen = complete()
    seen.services["/cameras/list"] = None
    assert "does not answer" in only_finding(seen).reason


def test_any_open_camera_will_do():
    seen = complete()
    for name in [name for name in seen.published if name.startswith("/cameras/")]:
        seen.published[name.replace("right_hand", "head")] = seen.published.pop(name)
    assert {one.verdict for one in compare(physical_robot(), seen)} == {Verdict.MET}
    del seen.published["/cameras/head_camera/image"]
    assert only_finding(seen).name.endswith("/image")


def test_silence_is_found_except_where_it_is_usual():
    seen = complete()
    seen.heard = {"/robot/state": None, "/robot/urdf": None}
    assert only_finding(seen).name == "/robot/state"


def joints(names, **others):
    values = [0.0] * len(names)
    return JointState(**{"name": list(names), "position": values, "velocity": values, "effort": values, **others})


ARMS = [name for side in SIDES for name in joint_names(side)]


@pytest.mark.parametrize("message, wrong", [
    (joints(["head_pan", *ARMS]), None),
    (joints(["l_gripper_l_finger_joint"]), None),  # the grippers of a physical robot have a publisher of their own
    (joints(ARMS[1:]), "left_s0"),
    (joints(ARMS, effort=[]), "0 efforts"),
    (joints([*ARMS, ARMS[0]]), "twice"),
    (joints(ARMS, velocity=[math.nan] * 14), "finite"),
])
def test_joint_states(message, wrong):
    seen = complete()
    seen.heard = {"/robot/joint_states": message}
    if wrong is None:
        assert {one.verdict for one in compare(physical_robot(), seen)} == {Verdict.MET}
    else:
        assert wrong in only_finding(seen).reason


def vector(x=0.0, y=0.0, z=0.0, w=0.0):
    return SimpleNamespace(x=x, y=y, z=z, w=w)


@pytest.mark.parametrize("topic, good, bad", [
    ("/robot/limb/left/endpoint_state", {"pose": SimpleNamespace(orientation=vector(w=1.0))},
     {"pose": SimpleNamespace(orientation=vector())}),
    ("/robot/end_effector/left_gripper/properties", {"ui_type": 3}, {"ui_type": 0}),
    ("/robot/digital_io/left_lower_cuff/state", {"state": 1}, {"state": -1}),
    ("/robot/navigators/torso_left_navigator/state",
     {"button_names": ["ok", "back", "show"], "light_names": ["inner", "outer"]},
     {"button_names": ["ok"], "light_names": []}),
    ("/robot/range/left_hand_range/state", {"min_range": 0.004, "max_range": 0.4},
     {"min_range": 0.0, "max_range": 0.0}),
    ("/robot/accelerometer/right_accelerometer/state", {"linear_acceleration": vector(z=9.8)},
     {"linear_acceleration": vector()}),
])
def test_contents(topic, good, bad):
    assert topic in physical_robot().published
    assert contents.wrong_with_message(topic, SimpleNamespace(**good)) is None
    assert contents.wrong_with_message(topic, SimpleNamespace(**bad))


def test_every_check_is_of_a_topic_of_the_robot():
    for pattern in contents.CHECKS:
        assert any(fnmatchcase(name, pattern) for name in physical_robot().published), pattern


@pytest.mark.parametrize("name, value, is_good", [
    ("/rethink/software_version", "1.2.0.57", True), ("/rethink/software_version", "1.1.1", False),
    ("/rethink/software_version", 1.2, False), ("/manifest/robot_serial", "", False),
    ("/robot_config/left_config/joint_names", list(joint_names("left")), True),
    ("/robot_config/left_config/joint_names", list(joint_names("right")), False),
    ("/robot_config/assembly_names", [], False), ("/robot_config/assembly_names", ["left"], True),
])
def test_parameters(name, value, is_good):
    wrong = contents.wrong_with_parameter(name, physical_robot().parameters[name], value)
    assert (wrong is None) == is_good, wrong


def test_an_interface_of_one_topic():
    robot = Interface({"/robot/state": "a/B"}, {}, {}, {}, (), ())
    assert comparison.scores(compare(robot, SeenInterface())) == {"/robot": (0, 1)}
