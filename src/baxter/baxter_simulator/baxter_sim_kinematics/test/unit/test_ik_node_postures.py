# SPDX-License-Identifier: BSD-3-Clause
"""Where the IK service takes its null-space postures from: Baxter's own, or a parameter for another robot."""
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path

import pytest

import baxter_model

NODE = Path(__file__).resolve().parents[2] / "nodes" / "position_kinematics"
TABLE = {"side": "left", "mirrored": ["turn"], "joints": ["turn", "lift"], "postures": {"neutral": [0.5, -0.25]}}


@pytest.fixture
def node(monkeypatch):
    """The node as a module, on a parameter server whose content is `parameters`."""
    loader = SourceFileLoader("position_kinematics", str(NODE))
    module = module_from_spec(spec_from_loader(loader.name, loader))
    loader.exec_module(module)
    module.parameters = {}
    monkeypatch.setattr(module.rospy, "get_param", lambda name, default=None: module.parameters.get(name, default))
    return module


@pytest.mark.parametrize("limb", baxter_model.SIDES)
def test_without_a_parameter_they_are_baxters(node, limb):
    assert node._null_space_postures(limb) == baxter_model.null_space_postures(limb)


@pytest.mark.parametrize(("limb", "turn"), [("left", 0.5), ("right", -0.5)])
def test_a_parameter_comes_first(node, limb, turn):
    node.parameters["~null_space_postures"] = TABLE
    assert node._null_space_postures(limb) == {"neutral": {limb + "_turn": turn, limb + "_lift": -0.25}}


@pytest.mark.parametrize("limb", ["", "a\x01b", "left arm", "/left", 3, None, ["left"]])
@pytest.mark.parametrize("name, value", [("~limb", lambda limb: limb), ("~limbs", lambda limb: ["right", limb])])
def test_a_limb_that_is_no_name_is_refused_with_what_is_allowed(node, name, value, limb):
    node.parameters[name] = value(limb)
    with pytest.raises(node.InvalidRequest) as found:
        node._limbs()
    assert ascii(limb) in str(found.value) and name in str(found.value) and "'left'" in str(found.value)


@pytest.mark.parametrize("limbs", ["left right", [], ["left", "left"], {"left": "right"}, 7, True])
def test_limbs_that_are_no_list_of_different_names_are_refused(node, limbs):
    node.parameters["~limbs"] = limbs
    with pytest.raises(node.InvalidRequest) as found:
        node._limbs()
    assert ascii(limbs) in str(found.value) and "[left, right]" in str(found.value)


def test_of_one_limb_the_node_itself_is_listed_and_of_several_each_limb(node):
    node.parameters["~limb"] = "left"
    assert node._limbs() == (["left"], False)
    node.parameters["~limbs"] = ["left", "right"]
    assert node._limbs() == (["left", "right"], True)


def test_a_frame_with_a_zero_is_refused_at_once_by_name(node):
    """tf2's library raises an error of its own for such names."""
    with pytest.raises(node.InvalidRequest, match=r"^'no\\x00where' is not a frame"):
        node.RobotFrames("base").pose_of("no\0where", node.rospy.Time(), node.time.monotonic() + 60.0)
