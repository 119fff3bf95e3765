# SPDX-License-Identifier: BSD-3-Clause
"""Joints of SDF in the <gazebo> elements of a URDF."""
import numpy as np
import pytest

from sdf_model import add_loops
from urdf_model import parse_urdf

LEGS = """<robot name="r"><link name="a"/><link name="b"/><link name="c"/><joint name="ab" type="continuous">
<parent link="a"/><child link="b"/><origin xyz="1 0 0" rpy="0 0 1.5707963267948966"/></joint><joint name="ac"
type="continuous"><parent link="a"/><child link="c"/></joint><gazebo><joint name="bc" type="%s"><parent>c</parent>
<child>b</child><pose>0 0.5 0 0 0 0</pose><axis><xyz>%s</xyz>%s</axis></joint></gazebo></robot>"""


@pytest.mark.parametrize(("axis", "more", "expected"), [
    ("0 2 0", "", (0, 1, 0)), ("0 1 0", "<use_parent_model_frame>1</use_parent_model_frame>", (1, 0, 0))])
def test_a_joint_in_a_gazebo_element_of_a_urdf_closes_a_loop(axis, more, expected):
    robot = parse_urdf(LEGS % ("revolute", axis, more))
    add_loops(robot)
    (loop,) = robot.loops
    assert (loop.name, loop.type, loop.parent, loop.child) == ("bc", "revolute", "c", "b")
    # b is turned by 90 degrees: half a metre along its y is along -x of the model.
    np.testing.assert_allclose(loop.in_parent[:3, 3], (0.5, 0, 0), atol=1e-9)
    np.testing.assert_allclose(loop.in_child[:3, 3], (0, 0.5, 0), atol=1e-9)
    np.testing.assert_allclose(loop.axis, expected, atol=1e-9)
    assert "line 3" in robot.warnings[0] and "loop" in robot.warnings[0]


@pytest.mark.parametrize(("kind", "axis", "said"), [
    ("screw", "0 0 1", "screw"), ("revolute", "0 0", "<axis/xyz> is '0 0'"), ("revolute", "0 0 0", "zero")])
def test_a_joint_in_a_gazebo_element_that_cannot_be_used_is_left_out(kind, axis, said):
    robot = parse_urdf(LEGS % (kind, axis, ""))
    add_loops(robot)
    assert robot.loops == [] and said in robot.warnings[0] and "line 3" in robot.warnings[0]
