# SPDX-License-Identifier: BSD-3-Clause
"""Where an arm would be for a pose of its hand: an arm of three joints in a plane, reach 0.9 m."""
import json
import math
import threading
from pathlib import Path

import numpy as np
import pytest

from arm_kinematics import Reason
from lab_testing.waiting import wait_until
from lab_web.hands import HandAnswers, ghost
from lab_web.scene import SceneFollower
from urdf_model import parse_urdf
from world_picture.snapshot import SnapshotWriter

LINK = """<link name="%s"><visual><geometry><box size="0.3 0.05 0.05"/></geometry></visual></link>"""
JOINT = """<joint name="%s" type="revolute"><parent link="%s"/><child link="%s"/><origin xyz="%s 0 0"/>
<axis xyz="0 0 1"/><limit lower="-2" upper="2" effort="1" velocity="1"/></joint>"""
ARM = "<robot name='arm'>%s%s<joint name='tool' type='fixed'><parent link='c'/><child link='tip'/>" \
      "<origin xyz='0.3 0 0'/></joint><link name='tip'/></robot>" % (
          "".join(LINK % name for name in ("base", "a", "b", "c")),
          "".join(JOINT % row for row in (("j1", "base", "a", 0), ("j2", "a", "b", 0.3), ("j3", "b", "c", 0.3))))
START = {"j1": 0.3, "j2": -0.6, "j3": 0.4, "other": 1.0}
TEXTS = Path(__file__).resolve().parents[2] / "page" / "texts" / "en.json"


def turned(angle):
    return [0.0, 0.0, math.sin(angle / 2.0), math.cos(angle / 2.0)]


@pytest.fixture
def hands():
    made = HandAnswers(lambda: dict(START), lambda chain, joints: sorted(joints), None)
    made.know(parse_urdf(ARM, source="arm"), {"left": ("base", "tip")}, pytest.fail)
    return made


def test_without_a_pose_the_hand_is_where_the_arm_has_it(hands):
    answer = hands.reached("left", {})
    assert answer["why"] == "" and answer["joints"] == {name: START[name] for name in ("j1", "j2", "j3")}
    assert answer["position"] == pytest.approx([0.3 * (math.cos(0.3) + math.cos(-0.3) + math.cos(0.1)),
                                                0.3 * (math.sin(0.3) + math.sin(-0.3) + math.sin(0.1)), 0.0])
    assert answer["orientation"] == pytest.approx(turned(0.1)) and answer["ghost"] == ["j1", "j2", "j3"]


def test_the_answer_puts_the_hand_on_the_pose(hands):
    answer = hands.reached("left", {"position": [0.6, 0.2, 0.0], "orientation": turned(0.3)})
    one, two, three = (answer["joints"][name] for name in ("j1", "j2", "j3"))
    angles = (one, one + two, one + two + three)
    assert answer["why"] == "" and answer["position"] == pytest.approx([0.6, 0.2, 0.0])
    assert sum(0.3 * math.cos(angle) for angle in angles) == pytest.approx(0.6, abs=1e-5)
    assert sum(0.3 * math.sin(angle) for angle in angles) == pytest.approx(0.2, abs=1e-5)
    assert angles[2] == pytest.approx(0.3, abs=1e-5)


@pytest.mark.parametrize(("pose", "why"), [
    ({"position": [2.0, 0.0, 0.0], "orientation": turned(0.0)}, "out_of_reach"),
    ({"position": [0.3, 0.0, 0.0], "orientation": turned(math.pi)}, "joint_limit"),
    ({"position": [0.3, 0.0], "orientation": turned(0.0)}, "invalid"),
    ({"position": [0.3, 0.0, float("nan")], "orientation": turned(0.0)}, "invalid"),
    ({"position": [0.3, 0.0, 0.0], "orientation": [0, 0, 0, 0]}, "invalid"),
    ({"position": [0.3, 0.0, 0.0]}, "invalid"),
    ({"position": "there"}, "invalid"),
    ({"position": [10 ** 400, 0, 0], "orientation": turned(0.0)}, "invalid"),
    ({"position": [0, 0, -10 ** 4000], "orientation": turned(0.0)}, "invalid"),
    ({"position": [0.3, 0.0, 0.0], "orientation": [0, 0, 10 ** 400, 1]}, "invalid"),
    ({"position": [0.3, 0.0, 0.0], "orientation": [0, 0, 0, float("nan")]}, "invalid"),
    ({"position": [0.3, 0.0, 0.0], "orientation": [float("inf"), 0, 0, 0]}, "invalid"),
    ({"position": [0.3, 0.0, 0.0], "orientation": [0, 0, 1]}, "invalid"),
    ({"position": [0.3, 0.0, 0.0], "orientation": "upright"}, "invalid"),
    ({"position": [0.3, 0.0, 0.0], "orientation": 1}, "invalid"),
    ({"position": [[0.3], [0.0], [0.0]], "orientation": turned(0.0)}, "invalid"),
    ({"position": ["a", "b", "c"], "orientation": turned(0.0)}, "invalid"),
    ({"position": [None, None, None], "orientation": turned(0.0)}, "invalid"),
    ({"position": {"x": 1, "y": 2, "z": 3}, "orientation": turned(0.0)}, "invalid"),
    ({"position": [], "orientation": []}, "invalid"),
    ({"position": None}, "invalid"),
    ({"position": [0.3] * 5000, "orientation": turned(0.0)}, "invalid"),
    ({"position": [1e308, -1e308, 0.0], "orientation": turned(0.0)}, "out_of_reach"),
    ({"position": [1e200, 0.0, 0.0], "orientation": turned(0.0)}, "out_of_reach")])
def test_a_pose_that_is_not_reached_has_its_reason(hands, pose, why):
    answer = hands.reached("left", pose)
    assert answer["why"] == why and 20 < len(answer["text"]) < 1000
    assert ("joints" in answer) == (why != "invalid")
    json.dumps(answer, allow_nan=False)


@pytest.mark.parametrize("side", ["right", "[1]"])
def test_a_hand_that_is_not_there_is_told(hands, side):
    assert hands.reached(side, {})["text"].endswith("there are left")


def test_before_the_joints_are_known_the_answer_says_which(hands):
    unknown = HandAnswers(dict, None, None)
    unknown.know(parse_urdf(ARM, source="arm"), {"left": ("base", "tip")}, pytest.fail)
    assert "no value for j1, j2, j3" in unknown.reached("left", {})["text"]


def test_an_arm_that_the_robot_lacks_is_left_out_with_a_warning():
    warned = []
    made = HandAnswers(dict, None, None)
    made.know(parse_urdf(ARM, source="arm"), {"left": ("base", "tip"), "right": ("base", "tail")}, warned.append)
    assert made.sides == ["left"] and "right" in warned[0] and "tail" in warned[0]


def test_the_page_has_a_text_for_each_reason():
    texts = json.loads(TEXTS.read_text(encoding="utf-8"))
    assert {"reach_" + reason.name.lower() for reason in Reason if "COLLISION" not in reason.name} <= texts.keys()


def test_each_page_gets_the_answer_to_its_newest_question():
    answers, going, asked = [], threading.Event(), threading.Event()

    def measured():
        asked.set()
        assert going.wait(60.0)
        return dict(START)
    made = HandAnswers(measured, lambda chain, joints: None, lambda *answer: answers.append(answer))
    made.know(parse_urdf(ARM, source="arm"), {"left": ("base", "tip")}, pytest.fail)
    ended = threading.Event()
    thread = threading.Thread(target=made.run, args=(ended.is_set,))
    thread.start()
    made.ask(1, {"op": "reach", "side": "left", "number": 0})
    assert asked.wait(60.0)
    for number in range(1, 100):
        for client in (1, 2):
            made.ask(client, {"op": "reach", "side": "left", "number": number})
    going.set()
    wait_until(lambda: len(answers) >= 3, "answers")
    ended.set()
    thread.join()
    assert [(client, answer["number"]) for client, answer in answers] == [(1, 0), (1, 99), (2, 99)]


@pytest.mark.parametrize(("root", "height"), [("", 0.0), (
    "<link name='stand'/><joint name='mount' type='fixed'><parent link='stand'/><child link='base'/>"
    "<origin xyz='0 0 0.2'/></joint>", 0.2)])
def test_the_ghost_is_the_arm_of_the_scene_where_the_robot_stands(tmp_path, hands, root, height):
    writer = SnapshotWriter(tmp_path)
    try:
        box = "<robot name='box'><link name='box'/></robot>"
        writer.write_scene([{"name": "box", "urdf": box, "joints": []},
                            {"name": "arm", "urdf": ARM.replace("<link name=\"base\">", root + "<link name=\"base\">"),
                             "joints": ["j1", "j2", "j3"]}])
        pose = [1.0, 2.0, 0.5, *turned(math.pi / 2.0)]
        writer.write(1, 0.0, [np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, *pose, 0.0, 0.0, 0.0])])
        follower = SceneFollower(writer.folder, pytest.fail)
        follower.follow()
        chain = hands._chains["left"]
        found = ghost(follower.picture, chain, {"j1": math.pi / 2.0, "j2": 0.0, "j3": 0.0})
        assert found["revision"] == follower.picture.revision
        assert found["base"] == pytest.approx([0, -1, 0, 1, 1, 0, 0, 2, 0, 0, 1, 0.5 + height], abs=1e-5)
        # The world's links: the box, the arm's base, then the three that move.
        assert sorted(found["links"]) == [2, 3, 4]
        assert found["links"][4] == pytest.approx([-1, 0, 0, 0.4, 0, -1, 0, 2, 0, 0, 1, 0.5 + height], abs=1e-5)
        assert ghost(follower.picture, chain, {"elsewhere": 0.0}) is None and ghost(None, chain, {}) is None
    finally:
        writer.close()
