# SPDX-License-Identifier: BSD-3-Clause
"""How visuals look besides their colour: pictures, light of their own, gloss."""
import numpy as np
import pytest

from urdf_model import Cylinder, Finish, Sphere, drawing_urdf, merge_fixed, parse_urdf

ROBOT = """<robot name="r">%s<link name="base"><visual><geometry><box size="1 2 3"/></geometry>%s</visual></link>
<link name="tip"><visual><geometry><sphere radius="1"/></geometry><material name="wood"/></visual></link>
<joint name="j" type="fixed"><parent link="base"/><child link="tip"/></joint>%s</robot>"""


def visuals(material="", beside="", more=""):
    return merge_fixed(parse_urdf(ROBOT % (beside, material, more))).links["base"].visuals


def test_a_material_may_have_a_picture_and_be_named_again():
    wood = '<material name="wood"><color rgba="1 0.5 1 1"/><texture filename="package://p/wood.png"/></material>'
    for first, second in (visuals(wood), visuals('<material name="wood"/>', wood)):
        assert first.finish == second.finish == Finish(texture="package://p/wood.png")
        assert first.colour == second.colour == (1.0, 0.5, 1.0, 1.0)


def test_without_a_picture_there_is_no_finish():
    assert {shape.finish for shape in visuals('<material name="wood"><color rgba="1 0 0 1"/></material>')} == {None}


def test_what_glows_in_gazebo_glows():
    glow = '<gazebo reference="base"><material>Gazebo/GreenGlow</material></gazebo>'
    (first, second), said = visuals(more=glow), (0.0, 1.0, 0.0)
    assert first.finish == Finish(emission=said) and first.colour == (0.1, 1.0, 0.1, 1.0) and second.finish is None


def test_the_drawing_keeps_everything():
    finish = Finish((0.1, 0.2, 0.3), 0.7, "/a/b.png", (2.0, 0.5), True, True)
    robot = parse_urdf(ROBOT % ("", "", ""))
    robot.links["base"].visuals[0].finish = finish
    again = parse_urdf(drawing_urdf(merge_fixed(robot))).links["base"].visuals
    assert [shape.finish for shape in again] == [finish, None]
    assert again[0].geometry.size == (1.0, 2.0, 3.0) and np.allclose(again[0].origin, np.eye(4))


@pytest.mark.parametrize("geometry", [Sphere(np.float64(0.1)), Cylinder(np.float64(0.1), np.float64(0.3))])
def test_a_drawing_takes_numbers_of_numpy(geometry):
    robot = parse_urdf(ROBOT % ("", "", ""))
    robot.links["base"].visuals[0].geometry = geometry
    assert parse_urdf(drawing_urdf(merge_fixed(robot))).links["base"].visuals[0].geometry == geometry


@pytest.mark.parametrize(("material", "text"), [
    ('<texture filename="a.png" repeats="1"/>', "expected 2"), ('<gloss/>', "has no value"),
    ('<emission rgb="1 1 much"/>', "rgb='much' is not a number")])
def test_what_is_wrong_in_it_is_named(material, text):
    robot = parse_urdf(ROBOT % ("", "<material name='m'>%s</material>" % material, ""))
    assert text in "".join(robot.warnings) and len(robot.links["base"].visuals) == 1
