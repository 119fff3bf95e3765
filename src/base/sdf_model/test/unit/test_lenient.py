# SPDX-License-Identifier: BSD-3-Clause
"""Deviations that Gazebo's reader accepts are accepted here, with a warning that names them and their place."""
import numpy as np
import pytest

from sdf_model import SdfError, parse_sdf_model, parse_sdf_world
from urdf_model.transforms import pose_matrix

LINK = '<link name="l">%s</link>'


def sdf(content, version="1.6"):
    return '<sdf version="%s">\n<model name="m">\n%s\n</model>\n</sdf>' % (version, content)


def read(content):
    return parse_sdf_model(sdf(content), "m.sdf")


@pytest.mark.parametrize(("shape", "field", "value"), [
    ('<cylinder radius="0.2" length="0.5"/>', "radius", 0.2), ('<cylinder radius="0.2" length="0.5"/>', "length", 0.5),
    ('<sphere radius="0.3"/>', "radius", 0.3), ('<box size="1 2 3"/>', "size", (1.0, 2.0, 3.0)),
    ('<mesh filename="model://can/can.dae" scale="2 2 2"/>', "filename", "model://can/can.dae"),
    ('<mesh filename="model://can/can.dae" scale="2 2 2"/>', "scale", (2.0, 2.0, 2.0))])
def test_attributes_for_elements(shape, field, value):
    model = read(LINK % '<collision name="c"><geometry>%s</geometry></collision>' % shape)
    geometry = model.robot.links["l"].collisions[0].geometry
    assert getattr(geometry, field) == pytest.approx(value) if not isinstance(value, str) else value
    assert "not as SDF has it, but read: attribute" in model.warning and "line 3" in model.warning


def test_an_old_model_of_attributes_is_what_it_says():
    model = read("""<link name="a"><inertial mass="2"><inertia ixx="1" iyy="1" izz="1"/></inertial></link>
<link name="b"><origin pose="1 0 0 0 0 0.5"/></link><joint name="j" type="revolute"><parent link="a"/><child link="b"/>
<axis xyz="0 1 0"><limit lower="-1" upper="2" effort="3"/><dynamics damping="0.4"/></axis></joint>""")
    joint = model.robot.joints["j"]
    assert model.robot.links["a"].inertial.mass == 2.0
    np.testing.assert_allclose(joint.origin, pose_matrix((1, 0, 0), (0, 0, 0.5)))
    assert (joint.limit.lower, joint.limit.upper, joint.limit.effort, joint.damping) == (-1.0, 2.0, 3.0, 0.4)
    assert "<origin pose>" in model.warning


def test_an_impossible_inertia_is_read_with_a_note():
    model = read(LINK % "<inertial><inertia><ixx>1</ixx><ixy>2</ixy><iyy>1</iyy><izz>1</izz></inertia></inertial>")
    assert model.robot.links["l"].inertial.inertia[0, 1] == 2.0
    assert "negative principal moment" in model.warning and "line 3" in model.warning


def test_an_element_goes_before_the_attribute_of_its_name_and_plugins_are_left_alone():
    model = read(LINK % '<collision name="c"><geometry><sphere radius="9"><radius>1</radius></sphere></geometry>'
                        '</collision>' + '<plugin filename="x.so"><limit lower="1"/></plugin>')
    assert model.robot.links["l"].collisions[0].geometry.radius == 1.0
    assert len(model.robot.gazebo[0].find("plugin/limit")) == 0 and model.warning == ""


@pytest.mark.parametrize("text", [
    "<!-- licence\n-->\n<?xml version='1.0'?>\n" + sdf(LINK % ""),
    sdf("<!-- m = 2 <!-- once more --- -->" + LINK % ""),
    sdf(LINK % '<visual name=v><geometry><sphere radius=0.3/></geometry></visual>'),
    sdf("<!-- a -- b -->" + LINK % '<visual name="v"><geometry><box><size>1 1 1</size></geometry></visual>')])
def test_comments_and_attributes_that_xml_does_not_allow(text):
    model = parse_sdf_model(text, "m.sdf")
    assert set(model.robot.links) == {"l"}
    assert "not as SDF has it, but read" in model.warning


def test_a_tidied_text_keeps_values_in_quotation_marks_and_lines():
    text = sdf('<!-- a -- \n b -->\n<link name="l r=s">\n<audio_sink/></link>')
    model = parse_sdf_model(text, "m.sdf")
    assert set(model.robot.links) == {"l r=s"} and "audio_sink (m.sdf line 6)" in model.warning


@pytest.mark.parametrize("text", [sdf(LINK % "")[:-9], "<!-- a -- b " + sdf(LINK % ""), sdf(LINK % "<a b=>"),
                                  "<!-- a -- -->" + '<!DOCTYPE sdf [<!ENTITY a "b">]>' + sdf(LINK % "&a;")])
def test_what_cannot_be_mended_is_refused(text):
    with pytest.raises(SdfError):
        parse_sdf_model(text, "m.sdf")


def test_a_missing_end_tag_ends_with_its_parent():
    text = sdf(LINK % '<collision name="c"><geometry><sphere><radius>0.3</radius></geometry></collision>')
    model = parse_sdf_model(text, "m.sdf")
    assert model.robot.links["l"].collisions[0].geometry.radius == 0.3
    assert "missing end tag" in model.warning and "line 3" in model.warning


@pytest.mark.parametrize("text", [sdf(LINK % "")[:40], sdf(LINK % "")[:-6], sdf(LINK % "<a b=></a>"),
                                  sdf(LINK % "&amp <") + "<"])
def test_what_breaks_off_or_is_no_xml_is_refused(text):
    with pytest.raises(SdfError, match="not well-formed"):
        parse_sdf_model(text, "m.sdf")


def test_a_pose_of_three_numbers_is_a_position():
    model = read(LINK % "<collision name='c'><pose>1 2 3</pose><geometry><sphere><radius>1</radius></sphere></geometry>"
                        "</collision>")
    np.testing.assert_allclose(model.robot.links["l"].collisions[0].origin, pose_matrix((1, 2, 3)))
    assert "<pose> of three numbers" in model.warning


def test_frames_by_their_old_name():
    model = read('<link name="a"><pose>1 0 0 0 0 0</pose></link>'
                 '<link name="b"><pose frame="a">0 2 0 0 0 0</pose></link>'
                 '<joint name="j" type="fixed"><parent>a</parent><child>b</child></joint>')
    np.testing.assert_allclose(model.robot.joints["j"].origin[:3, 3] + model.robot.joints["j"].child_offset[:3, 3],
                               (0, 2, 0))


def test_a_joint_without_axis_turns_about_z_and_a_shape_without_geometry_is_left_out():
    model = read(LINK % '<collision name="c"/>' + '<link name="b"/><joint name="j" type="revolute"><parent>l</parent>'
                                                  "<child>b</child></joint>")
    np.testing.assert_allclose(model.robot.joints["j"].axis, (0, 0, 1))
    assert model.robot.links["l"].collisions == []
    assert "without <axis>" in model.warning and "without a shape" in model.warning


def test_kinematic_models_stand_fast():
    assert read(LINK % "<kinematic>true</kinematic>").static
    assert not read(LINK % "<kinematic>false</kinematic>").static
    mixed = read(LINK % "<kinematic>1</kinematic>" + '<link name="b"/>')
    assert not mixed.static and "kinematic of link 'l'" in mixed.warning


def read_world(tmp_path, content):
    path = tmp_path / "a.world"
    path.write_text('<sdf version="1.6">\n<world name="w">\n%s\n</world></sdf>' % content)
    return parse_sdf_world(path)


def test_a_road_is_seen_and_touches_nothing(tmp_path):
    found = read_world(tmp_path, '<road name="lane"><width>2</width><point>0 0 0</point><point>10 0 0</point>'
                                 "<point>10 4 3</point></road>")
    lane, = found.models
    parts = lane.robot.links["link"].visuals
    assert lane.static and lane.robot.links["link"].collisions == [] and found.warning == ""
    assert [part.geometry.size[:2] for part in parts] == [pytest.approx((10.0, 2.0)), pytest.approx((5.0, 2.0))]
    # The second begins where the first ends, and goes up.
    begin = parts[1].origin @ (-2.5, 0.0, 0.0, 1.0)
    np.testing.assert_allclose(begin[:3], (10, 0, 0), atol=1e-9)
    broken = read_world(tmp_path, "<road><point>0 0 0</point></road>")
    assert broken.models == [] and "two points and more" in broken.problems[0]


def test_plugins_of_the_world_are_named(tmp_path):
    assert "plugin 'libwind.so'" in read_world(tmp_path, '<plugin name="p" filename="libwind.so"/>').warning


def test_gravity_as_an_attribute(tmp_path):
    found = read_world(tmp_path, '<physics><gravity xyz="0 0 -3.7"/></physics>')
    assert found.gravity == (0.0, 0.0, -3.7)
