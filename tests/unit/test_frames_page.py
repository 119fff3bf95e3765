# SPDX-License-Identifier: BSD-3-Clause
"""The tree that docs/frames.md draws is the tree of the robot model."""
import re
from pathlib import Path

import pytest
import rospkg

import xacro
from urdf_model import parse_urdf

PAGE = Path(__file__).resolve().parents[2] / "docs" / "frames.md"
VARIANTS = ({}, {"left_gripper": "suction", "right_gripper": "suction"}, {"kinect": "true"})
LINE = re.compile(r" {4}( *)(?:\[(\w+)\] )?(\w+)(?: {2,}.*)?$")


def drawn_tree():
    """{child: (parent, joint that moves it or "")} of the page, with both sides expanded."""
    tree, above = {}, []
    drawing = PAGE.read_text().partition("<!-- tree:")[2].partition("\n##")[0]
    for line in drawing.splitlines():
        match = LINE.match(line)
        if match is None:
            continue
        indent, joint, link = match.groups()
        above = [*above[:len(indent) // 2], link]
        for side in ("left", "right"):
            parent, child, moved_by = ((name or "").replace("SIDE_", side + "_").replace("S_", side[0] + "_")
                                       for name in (above[-2] if len(above) > 1 else "", link, joint))
            tree[child] = (parent, moved_by)
    return tree


def model_tree():
    """The same of the robot model, all variants together."""
    file = rospkg.RosPack().get_path("baxter_description") + "/urdf/baxter.urdf.xacro"
    tree = {"world": ("", ""), "base": ("world", "")}  # the launch file defines this joint
    for arguments in VARIANTS:
        robot = parse_urdf(xacro.process_file(file, mappings=dict(arguments)).toxml(), source=file)
        tree.update({joint.child: (joint.parent, joint.name if joint.movable else "")
                     for joint in robot.joints.values()})
    return tree


@pytest.mark.parametrize("drawn, model", [(drawn_tree, model_tree), (model_tree, drawn_tree)],
                         ids=["nothing invented", "nothing left out"])
def test_page_and_model_draw_the_same_tree(drawn, model):
    model = model()
    wrong = {child: (place, model.get(child)) for child, place in drawn().items() if model.get(child) != place}
    assert not wrong
