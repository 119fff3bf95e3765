# SPDX-License-Identifier: BSD-3-Clause
"""SDF models become robots that stand where SDF says."""
import math
import subprocess
import sys

import numpy as np
import pytest

from sdf_model import ModelFolders, SdfError, description_file, parse_sdf_model, parse_sdf_world
from urdf_model import Box, Cylinder, Gear, Mesh, Plane, Sphere, drawing_urdf, gazebo_links, merge_fixed, parse_urdf
from urdf_model.transforms import axis_rotation, pose_matrix, rigid

LINK = '<link name="%s"><pose>%s</pose></link>'


def sdf(content, version="1.6", name="m"):
    return '<sdf version="%s">\n<model name="%s">\n%s\n</model>\n</sdf>' % (version, name, content)


def read(content, **options):
    model = parse_sdf_model(sdf(content, **options), "m.sdf")
    assert model.warning == ""
    return model


def where(robot, positions=None):
    """Every link's 4x4 frame in the model, from the merged bodies."""
    merged = merge_fixed(robot)
    bodies = {root: np.eye(4) for root in merged.roots}
    for joint in merged.joints.values():
        value = (positions or {}).get(joint.name, 0.0)
        if joint.type == "prismatic":
            move = rigid(np.eye(3), joint.axis * value)
        else:
            move = rigid(axis_rotation(joint.axis, value), (0, 0, 0))
        bodies[joint.child] = bodies[joint.parent] @ joint.origin @ move
    return {name: bodies[frame.link] @ frame.offset for name, frame in merged.frames.items()}


def joint(name, parent, child, kind="revolute", pose="0 0 0 0 0 0", axis="<axis><xyz>0 0 1</xyz></axis>"):
    return '<joint name="%s" type="%s"><parent>%s</parent><child>%s</child><pose>%s</pose>%s</joint>' % (
        name, kind, parent, child, pose, axis if kind != "fixed" else "")


# -- links -----------------------------------------------------------------------------------------


def test_a_link_has_its_shapes_inertia_surface_and_colours():
    model = read("""<static>true</static><link name="l">
      <inertial><pose>0 0 1 0 0 1.5707963267948966</pose><mass>2</mass>
        <inertia><ixx>1</ixx><iyy>2</iyy><izz>2.5</izz></inertia></inertial>
      <gravity>false</gravity>
      <collision name="c"><pose>1 2 3 0 0 0</pose><geometry><box><size>1 2 3</size></box></geometry>
        <surface><friction><ode><mu>0.4</mu></ode></friction><contact><ode><kp>1e5</kp><kd>2</kd></ode></contact>
          <bounce><restitution_coefficient>0.7</restitution_coefficient><threshold>0</threshold></bounce></surface></collision>
      <visual name="a"><geometry><cylinder><radius>1</radius><length>2</length></cylinder></geometry>
        <material><script><name>Gazebo/Red</name></script></material></visual>
      <visual name="b"><geometry><sphere><radius>1</radius></sphere></geometry>
        <material><diffuse>0 1 0 1</diffuse></material><transparency>0.25</transparency></visual>
      <visual name="d"><geometry><mesh><uri>model://x/y.stl</uri><scale>2 2 2</scale></mesh></geometry></visual>
    </link>""")
    link = model.robot.links["l"]
    assert model.static and not link.gravity
    assert link.inertial.mass == 2 and link.inertial.centre.tolist() == [0, 0, 1]
    np.testing.assert_allclose(np.diag(link.inertial.inertia), (2, 1, 2.5))
    assert link.collisions[0].geometry == Box((1, 2, 3)) and link.collisions[0].origin[:3, 3].tolist() == [1, 2, 3]
    surface = link.surface
    assert (surface.friction, surface.stiffness, surface.damping, surface.restitution) == (0.4, 1e5, 2, 0.7)
    assert [shape.geometry for shape in link.visuals] == [Cylinder(1, 2), Sphere(1), Mesh("model://x/y.stl", (2, 2, 2))]
    assert [shape.colour for shape in link.visuals] == [(0.9, 0.1, 0.1, 1.0), (0, 1, 0, 0.75), None]


@pytest.mark.parametrize("modulus, stiffness", [(5e5, None), (-1.0, 1.0), (0.0, 1.0)])
def test_kp_says_nothing_of_a_body_with_an_elastic_modulus(modulus, stiffness):
    """As of Gazebo's elastic_modulus_contact_test.world."""
    content = """<link name="l"><collision name="c"><geometry><sphere><radius>1</radius></sphere></geometry><surface>
        <contact><elastic_modulus>%g</elastic_modulus><ode><kp>1</kp><kd>2</kd></ode></contact></surface></collision></link>"""
    model = parse_sdf_model(sdf(content % modulus), "m.sdf")
    assert model.robot.links["l"].surface.stiffness == stiffness
    assert ("elastic_modulus (m.sdf line 4)" in model.warning) is (stiffness is None)


@pytest.mark.parametrize(("threshold", "restitution"), [
    ("", None), ("<threshold>1e+06</threshold>", None), ("<threshold>0.1</threshold>", 0.9)])
def test_a_body_bounces_where_its_threshold_lets_it(threshold, restitution):
    """In Gazebo the threshold is 100000 m/s where a description says none."""
    found = parse_sdf_model(
        '<sdf version="1.7"><model name="m"><link name="l"><collision name="c"><geometry><box><size>1 1 1'
        "</size></box></geometry><surface><bounce><restitution_coefficient>0.9</restitution_coefficient>%s</bounce><contact><ode>"
        "<kp>1</kp></ode></contact></surface></collision></link></model></sdf>" % threshold, "m.sdf")
    assert found.robot.links["l"].surface.restitution == restitution and found.warning == ""


@pytest.mark.parametrize("mu", ["inf", "Inf", "-1"])
def test_a_friction_without_a_bound_is_infinite(mu):
    model = read("""<link name="l"><collision name="c"><geometry><sphere><radius>1</radius></sphere></geometry>
        <surface><friction><ode><mu>%s</mu></ode></friction><contact><ode><kp>inf</kp></ode></contact></surface>
        </collision></link>""" % mu)
    surface = model.robot.links["l"].surface
    assert (surface.friction, surface.stiffness) == (math.inf, math.inf)


@pytest.mark.parametrize(("physics", "implicit"), [
    ("<implicit_spring_damper>1</implicit_spring_damper>", True), ("<cfm_damping>true</cfm_damping>", True),
    ("<implicit_spring_damper>0</implicit_spring_damper>", False), ("", False)])
def test_damping_may_be_implicit(physics, implicit):
    joint = read("""<link name="a"/><link name="b"/><joint name="j" type="revolute"><parent>a</parent><child>b</child>
    <axis><xyz>0 0 1</xyz><dynamics><damping>0.4</damping></dynamics></axis><physics><ode>%s</ode></physics>
    </joint>""" % physics).robot.joints["j"]
    assert (joint.damping, joint.implicit_damping) == (0.4, implicit)


def test_a_link_without_inertia_has_the_defaults_of_sdf():
    inertial = read('<link name="l"/>').robot.links["l"].inertial
    assert inertial.mass == 1.0 and np.array_equal(inertial.inertia, np.eye(3))


def test_a_plane_faces_its_normal():
    shape, = read('<link name="l"><collision name="c"><geometry><plane><normal>-3 0 4</normal><size>5 6</size></plane>'
                  "</geometry></collision></link>").robot.links["l"].collisions
    assert shape.geometry == Plane((5, 6))
    np.testing.assert_allclose(shape.origin[:3, 2], (-0.6, 0, 0.8), atol=1e-12)


def test_meshes_beside_the_file_are_found_from_anywhere(tmp_path):
    content = '<link name="l"><visual name="v"><geometry><mesh><uri>a/b.stl</uri></mesh></geometry></visual></link>'
    model = parse_sdf_model(sdf(content), "m.sdf", folder=tmp_path)
    assert model.robot.links["l"].visuals[0].geometry.filename == str(tmp_path / "a/b.stl")


# -- frames and joints -----------------------------------------------------------------------------


def test_links_stand_where_their_poses_in_the_model_say():
    poses = {"a": "1 2 3 0.1 0.2 0.3", "b": "-1 0 0.5 0 1 0", "c": "0 0 2 1 0 0"}
    content = "".join(LINK % item for item in poses.items())
    robot = read(content + joint("j", "a", "b", pose="0.3 0.2 0.1 0.5 0.4 0.3") + joint("k", "b", "c", "fixed")).robot
    found = where(robot)
    for name, text in poses.items():
        numbers = [float(word) for word in text.split()]
        np.testing.assert_allclose(found[name], pose_matrix(numbers[:3], numbers[3:]), atol=1e-12, err_msg=name)


def test_a_link_turns_about_its_joint_wherever_that_is():
    """A door of 1 m with its hinge at the edge: the link's frame is in the middle."""
    robot = read(LINK % ("frame", "0 0 0 0 0 0") + LINK % ("door", "0.5 0 0 0 0 0")
                 + joint("hinge", "frame", "door", pose="-0.5 0 0 0 0 0")).robot
    np.testing.assert_allclose(where(robot, {"hinge": math.pi / 2})["door"][:3, 3], (0, 0.5, 0), atol=1e-12)


@pytest.mark.parametrize("version, extra, expected", [
    ("1.6", "", (0, -1, 0)),  # in the joint's frame, which is turned by 90 degrees about x
    ("1.4", "", (0, 0, 1)),  # in the model's
    ("1.6", "<use_parent_model_frame>true</use_parent_model_frame>", (0, 0, 1))])
def test_an_axis_is_read_in_the_frame_that_the_version_means(version, extra, expected):
    axis = "<axis><xyz>0 0 1</xyz>%s</axis>" % extra
    robot = read(LINK % ("a", "0 0 0 0 0 0") + LINK % ("b", "0 0 0 1.5707963267948966 0 0")
                 + joint("j", "a", "b", "prismatic", axis=axis), version=version).robot
    moved = where(robot, {"j": 2.0})["b"][:3, 3]
    np.testing.assert_allclose(moved, 2.0 * np.array(expected), atol=1e-12)


def test_an_axis_may_be_expressed_in_a_named_frame():
    axis = '<axis><xyz expressed_in="turned">0 0 1</xyz></axis>'
    robot = read('<frame name="turned"><pose>0 0 0 0 1.5707963267948966 0</pose></frame>'
                 + LINK % ("a", "0 0 0 0 0 0") + LINK % ("b", "0 0 1 0 0 0")
                 + joint("j", "a", "b", "prismatic", axis=axis), version="1.7").robot
    np.testing.assert_allclose(where(robot, {"j": 2.0})["b"][:3, 3], (2, 0, 1), atol=1e-12)


def test_a_joint_written_from_the_other_end_keeps_its_sign():
    """Two joints have link c as their child; the tree must turn one of them round."""
    content = LINK % ("a", "0 0 0 0 0 0") + LINK % ("b", "2 0 0 0 0 0") + LINK % ("c", "1 0 0 0 0 0")
    robot = read(content + joint("j", "a", "c") + joint("k", "b", "c")).robot
    assert robot.root == "a" and robot.joints["k"].parent == "c"
    found = where(robot, {"k": 0.3})
    relative = np.linalg.inv(found["b"]) @ found["c"]
    np.testing.assert_allclose(relative[:3, :3], axis_rotation((0, 0, 1), 0.3), atol=1e-12)


def test_limits_are_those_written_and_none_where_sdf_means_none():
    limits = "<axis><xyz>0 0 1</xyz><limit><lower>%s</lower><upper>%s</upper><effort>%s</effort></limit></axis>"
    content = LINK % ("a", "0 0 0 0 0 0") + LINK % ("b", "0 0 0 0 0 0") + LINK % ("c", "0 0 0 0 0 0")
    robot = read(content + joint("j", "a", "b", axis=limits % (-1, 2, 3))
                 + joint("k", "b", "c", axis=limits % ("-1e16", "1e16", -1))).robot
    first, second = robot.joints["j"], robot.joints["k"]
    assert (first.type, first.limit.lower, first.limit.upper, first.limit.effort) == ("revolute", -1, 2, 3)
    assert (second.type, second.limit.lower, second.limit.effort) == ("continuous", None, None)


def test_a_model_welded_to_the_world_is_static():
    model = read(LINK % ("b", "0 0 2 0 0 0") + LINK % ("a", "0 0 1 0 0 0") + joint("weld", "world", "a", "fixed")
                 + joint("j", "a", "b"))
    assert model.static and model.robot.root == "a" and list(model.robot.joints) == ["j"]
    assert where(model.robot)["a"][2, 3] == 1.0


def test_a_hinge_on_the_world_has_the_world_for_its_root():
    robot = read(LINK % ("a", "0 0 1 0 0 0") + joint("hinge", "world", "a")).robot
    assert robot.root == "world" and where(robot)["a"][2, 3] == 1.0


def test_poses_may_be_relative_to_other_frames():
    robot = read("""<frame name="f"><pose>1 0 0 0 0 0</pose></frame>
      <link name="a"><pose relative_to="f">0 1 0 0 0 0</pose></link>
      <link name="b"><pose relative_to="a">0 0 1 0 0 0</pose></link>""" + joint("j", "a", "b", "fixed")).robot
    assert where(robot)["b"][:3, 3].tolist() == [1, 1, 1]


def test_nested_models_are_flattened_with_scoped_names():
    robot = read('<link name="a"/><model name="arm"><pose>0 0 1 0 0 0</pose><link name="a"><pose>1 0 0 0 0 0</pose>'
                 '</link><link name="b"/>%s</model>%s'
                 % (joint("j", "a", "b"), joint("k", "a", "arm::a", "fixed"))).robot
    assert list(robot.links) == ["a", "arm::a", "arm::b"] and set(robot.joints) == {"arm::j", "k"}
    assert where(robot)["arm::a"][:3, 3].tolist() == [1, 0, 1]


def test_what_a_tree_cannot_have_is_said():
    content = LINK % ("a", "0 0 0 0 0 0") + LINK % ("b", "1 0 0 0 0 0")
    loop = parse_sdf_model(sdf(content + joint("j", "a", "b") + joint("k", "a", "b")), "m.sdf")
    assert "joint 'k', which closes a loop (m.sdf line 3)" in loop.warning
    (closing,) = loop.robot.loops
    assert (closing.name, closing.type, closing.parent, closing.child) == ("k", "continuous", "a", "b")
    assert closing.in_parent[:3, 3].tolist() == [1, 0, 0] and closing.in_child[:3, 3].tolist() == [0, 0, 0]
    loose = parse_sdf_model(sdf(content), "m.sdf")
    assert where(loose.robot)["b"][0, 3] == 1.0 and loose.warning == ""
    assert merge_fixed(loose.robot).loose == ("b",) and merge_fixed(loose.robot, held=True).loose == ()
    assert merge_fixed(parse_sdf_model(sdf("<static>1</static>" + content), "m.sdf").robot).loose == ()
    unknown = parse_sdf_model(sdf(content + joint("j", "a", "b", "rope")), "m.sdf")
    assert "joint 'j' of type rope, which is held fixed" in unknown.warning


def test_screws_and_gearboxes_couple_joints_also_in_a_model_inside_of_another():
    content = LINK % ("a", "0 0 0 0 0 0") + LINK % ("b", "1 0 0 0 0 0") + LINK % ("c", "2 0 0 0 0 0")
    screw = joint("j", "a", "b", "screw", axis="<axis><xyz>0 0 1</xyz></axis><thread_pitch>4</thread_pitch>")
    found = parse_sdf_model(sdf(content + screw), "m.sdf")
    assert [(each.name, each.type) for each in found.robot.joints.values()][:2] == [
        ("j", "continuous"), ("j_axis2", "prismatic")]
    assert found.robot.gears == [Gear("j", "j_axis2", -0.25)] and found.warning == ""
    nested = parse_sdf_model('<sdf version="1.6"><model name="o"><model name="m">%s</model></model></sdf>'
                             % (content + screw), "m.sdf")
    assert nested.robot.gears == [Gear("m::j", "m::j_axis2", -0.25)]
    box = ('<joint name="g" type="gearbox"><parent>a</parent><child>c</child><gearbox_ratio>2</gearbox_ratio>'
           "<gearbox_reference_body>%s</gearbox_reference_body><axis><xyz>0 0 1</xyz></axis><axis2><xyz>0 0 %d</xyz>"
           "</axis2></joint>")
    hinges = joint("h", "b", "a") + joint("i", "c", "b")
    for sign in (1, -1):
        # Of joint i the reference body is the child: it turns the other way.
        found = parse_sdf_model(sdf(content + hinges + box % ("b", sign)), "m.sdf")
        assert found.robot.gears == [Gear("h", "i", 2.0 * sign)] and found.warning == ""
    lost = parse_sdf_model(sdf(content + hinges + box % ("a", 1)), "m.sdf")
    assert "gearbox 'g': no hinge joins 'a' and the reference body 'a'" in lost.warning and not lost.robot.gears
    mended = parse_sdf_model(sdf(content + screw.replace(">4<", ">0<")), "m.sdf")
    assert "<thread_pitch> of 0, for which 1 is used" in mended.warning


def test_a_joint_of_several_axes_is_a_chain_of_hinges():
    content = LINK % ("a", "0 0 0 0 0 0") + LINK % ("b", "1 0 0 0 0 0")
    second = ("<axis><xyz>0 0 1</xyz><limit><lower>-0.5</lower><upper>0.5</upper></limit></axis><axis2><xyz>0 1 0</xyz>"
              "<dynamics><damping>0.2</damping></dynamics></axis2>")
    found = parse_sdf_model(sdf(content + joint("j", "a", "b", "revolute2", axis=second)), "m.sdf")
    steering, rolling = found.robot.joints.values()
    assert (steering.name, steering.type, steering.parent, steering.child) == ("j", "revolute", "a", "j_cross1")
    assert (rolling.name, rolling.type, rolling.parent, rolling.child) == ("j_axis2", "continuous", "j_cross1", "b")
    assert (steering.axis.tolist(), steering.limit.upper) == ([0, 0, 1], 0.5)
    assert (rolling.axis.tolist(), rolling.damping) == ([0, 1, 0], 0.2)
    assert list(gazebo_links(found.robot)) == ["a", "b"] and found.warning == ""
    ball = parse_sdf_model(sdf(content + joint("j", "world", "b", "ball")), "m.sdf").robot
    assert [each.axis.tolist() for each in ball.joints.values()][:3] == np.eye(3).tolist()
    assert where(ball)["b"][0, 3] == 1.0


# -- what a viewer is given ------------------------------------------------------------------------


def test_the_drawing_of_a_model_is_a_urdf_with_the_same_bodies_in_the_same_places():
    model = read(LINK % ("a", "1 2 3 0.1 0.2 0.3")
                 + '<link name="b"><pose>-1 0 0.5 0 1.5707963267948966 0</pose>'
                 '<visual name="v"><pose>0 0 1 0 0 0</pose>'
                 "<geometry><box><size>1 2 3</size></box></geometry><material><diffuse>1 0 0 1</diffuse></material>"
                 "</visual></link>" + joint("j", "a", "b", pose="0.3 0.2 0.1 0.5 0.4 0.3"))
    merged = merge_fixed(model.robot)
    drawn = merge_fixed(parse_urdf(drawing_urdf(merged)))
    assert list(drawn.joints) == list(merged.joints) and list(drawn.links) == list(merged.links)
    np.testing.assert_allclose(drawn.joints["j"].origin, merged.joints["j"].origin, atol=1e-12)
    shape, = drawn.links["b"].visuals
    np.testing.assert_allclose(shape.origin, merged.links["b"].visuals[0].origin, atol=1e-12)
    assert shape.colour == (1, 0, 0, 1)


# -- worlds ----------------------------------------------------------------------------------------


@pytest.fixture
def shelf(tmp_path):
    """Folders with two models, one of which has a model.config that names a newer file."""
    (tmp_path / "one/can").mkdir(parents=True)
    (tmp_path / "one/can/model.sdf").write_text(sdf('<pose>0 0 9 0 0 0</pose><link name="l"/>', name="can"))
    (tmp_path / "two/lamp").mkdir(parents=True)
    (tmp_path / "two/lamp/new.sdf").write_text(
        '<sdf version="1.6"><light name="lamp" type="point"><diffuse>1 0 0 1</diffuse></light></sdf>')
    (tmp_path / "two/lamp/old.sdf").write_text("<sdf/>")
    (tmp_path / "two/lamp/model.config").write_text(
        '<model><sdf version="1.4">old.sdf</sdf><sdf version="1.10">new.sdf</sdf></model>')
    return ModelFolders([tmp_path / "one", tmp_path / "two"])


def world(tmp_path, content, folders=None):
    path = tmp_path / "a.world"
    path.write_text('<sdf version="1.6">\n<world name="w">\n%s\n</world>\n</sdf>' % content, encoding="utf-8")
    return parse_sdf_world(path, folders)


def test_an_include_brings_models_and_lights(tmp_path, shelf):
    found = world(tmp_path, """<include><uri>model://can</uri></include>
      <include><uri>model://can</uri><name>second</name><pose>1 2 3 0 0 0</pose><static>true</static></include>
      <include><uri>model://lamp</uri></include>""", shelf)
    assert (found.problems, found.warning) == ([], "")
    assert [(model.name, model.pose[:3, 3].tolist(), model.static) for model in found.models] == [
        ("can", [0, 0, 9], False), ("second", [1, 2, 3], True)]
    assert [(light.name, light.diffuse) for light in found.lights] == [("lamp", (1, 0, 0, 1))]


def test_light_and_ambience(tmp_path):
    found = world(tmp_path, """<scene><ambient>0.1 0.2 0.3 1</ambient><shadows>false</shadows></scene>
      <light name="beam" type="spot"><pose>0 0 2 0 0 0</pose><attenuation><range>5</range><linear>0.1</linear>
      </attenuation><spot><inner_angle>0.5</inner_angle><outer_angle>0.7</outer_angle><falloff>2</falloff></spot></light>
      <light name="bulb" type="point"/>""")
    assert (found.problems, found.warning) == ([], "")
    assert (found.scene.ambient, found.scene.background, found.scene.shadows) == ((0.1, 0.2, 0.3), None, False)
    beam, bulb = found.lights
    assert (beam.spot, beam.range_m, beam.attenuation) == ((0.5, 0.7, 2.0), 5.0, (1.0, 0.1, 0.0))
    assert (bulb.spot, bulb.range_m) == (None, 10.0)


def test_a_saved_state_says_where_the_lights_are(tmp_path, shelf):
    found = world(tmp_path, '<light name="lamp" type="point"><pose>0 0 1 0 0 0</pose></light><state world_name="w">'
                            '<light name="lamp"><pose>0 0 3 0 0 0</pose></light><light name="gone"/></state>', shelf)
    assert found.lights[0].pose[2, 3] == 3.0 and found.warning == ""


def test_a_saved_state_says_where_the_models_are(tmp_path, shelf):
    found = world(tmp_path, '<include><uri>model://can</uri></include><state world_name="w"><model name="can">'
                            "<pose>5 0 0 0 0 0</pose></model></state>", shelf)
    assert found.models[0].pose[0, 3] == 5.0


def test_plugins_of_models_and_includes_are_kept(tmp_path, shelf):
    found = world(tmp_path, '<include><uri>model://can</uri><plugin name="p" filename="liba.so"><x>1</x></plugin>'
                            "</include>", shelf)
    plugin, = [plugin for gazebo in found.models[0].robot.gazebo for plugin in gazebo.findall("plugin")]
    assert plugin.get("filename") == "liba.so" and plugin.findtext("x") == "1"


def test_what_cannot_be_had_is_a_line_and_the_rest_is_there(tmp_path, shelf):
    found = world(tmp_path, """<include><uri>model://castle</uri></include>
<include><uri>model://can</uri></include>
<include><uri>model://can</uri><name>can</name></include>
<model name="bad"><link name="l"><inertial><mass>much</mass></inertial></link></model>""", shelf)
    assert [model.name for model in found.models] == ["can"]
    missing, twice, massless = found.problems
    assert "a.world, line 3" in missing and "model://castle not found" in missing and "one" in missing
    assert "GAZEBO_MODEL_PATH" in missing
    assert "line 5" in twice and "appears twice" in twice and "<name>" in twice
    assert "line 6" in massless and "<mass> is 'much'" in massless


def test_what_is_not_understood_is_one_warning_with_file_and_lines(tmp_path, shelf):
    can = shelf.find("model://can")
    can.write_text(sdf('<link name="l">\n<audio_sink name="s" type="ray"/></link>', name="can"))
    found = world(tmp_path, "<population/>\n<plugin filename='walker'/>\n<population/>\n<include><uri>model://can</uri></include>\n"
                            "<scene/><gui/>", shelf)
    assert found.warning.count("not understood") == found.warning.count("without an effect") == 1
    assert "population (%s line 3, 5)" % (tmp_path / "a.world") in found.warning
    assert "plugin 'walker' (" in found.warning
    assert "audio_sink (%s line 4)" % can in found.warning and "scene" not in found.warning


def test_an_actor_is_a_static_figure_with_a_plugin_that_moves_it(tmp_path, shelf):
    walker = """<actor name="walker"><pose>0 0 1 0 0 0</pose><skin><filename>walk.dae</filename><scale>1.5</scale>
</skin>
<animation name="walking"><filename>walk.dae</filename></animation><script><loop>false</loop>
<trajectory id="0" type="walking"><waypoint><time>0</time><pose>0 0 1 0 0 0</pose></waypoint>
<waypoint><time>%s</time><pose>4 0 1 0 0 0</pose></waypoint></trajectory></script></actor>"""
    shelf.find("model://can").write_text('<sdf version="1.6">%s</sdf>' % walker % 2)
    found = world(tmp_path, walker % 4 + "<include><uri>model://can</uri><name>second</name></include>", shelf)
    assert found.problems == [] and "animation" in found.warning
    assert [(model.name, model.static, model.pose[2, 3]) for model in found.models] == [
        ("walker", True, 1.0), ("second", True, 1.0)]
    robot = found.models[0].robot
    (shape,) = robot.links["link"].visuals
    assert shape.geometry == Mesh(str(tmp_path / "walk.dae"), (1.5,) * 3) and robot.links["link"].collisions == []
    (plugin,) = robot.gazebo[0].findall("plugin")
    assert plugin.get("filename") == "libactor_trajectory.so" and plugin.findtext("loop") == "false"
    assert [point.findtext("time") for point in plugin.iterfind("trajectory/waypoint")] == ["0", "4"]
    found = world(tmp_path, walker % "soon", shelf)
    assert found.models == [] and "<time> is 'soon'" in found.problems[0]


def test_an_include_in_a_circle_ends(tmp_path, shelf):
    shelf.find("model://can").write_text(sdf('<link name="l"/><include><uri>model://can</uri><name>n</name></include>'))
    found = world(tmp_path, "<include><uri>model://can</uri></include>", shelf)
    assert len(found.problems) == 1 and "circle" in found.problems[0]


def test_a_model_folder_may_lack_its_config(tmp_path, shelf):
    assert description_file(tmp_path / "one/can").name == "model.sdf"
    assert description_file(tmp_path / "two/lamp").name == "new.sdf"
    assert description_file(tmp_path / "nowhere") is None
    assert shelf.find("can").parent.name == "can" and shelf.find("http://can") is None


def test_a_joint_may_have_the_name_of_a_link():
    model = read('<link name="base"><pose>1 0 0 0 0 0</pose></link><link name="wheel"><pose>0 2 0 0 0 0</pose></link>'
                 '<link name="cap"><pose relative_to="wheel">0 0 3 0 0 0</pose></link>'
                 + joint("wheel", "base", "wheel", pose="0 0 0.5 0 0 0") + joint("cap", "wheel", "cap", "fixed"))
    assert set(model.robot.joints) == {"wheel", "cap"} and model.robot.joints["wheel"].child == "wheel"
    at_rest = where(model.robot)
    np.testing.assert_allclose(at_rest["wheel"][:3, 3], (0, 2, 0), atol=1e-12)
    np.testing.assert_allclose(at_rest["cap"][:3, 3], (0, 2, 3), atol=1e-12)
    np.testing.assert_allclose(model.robot.joints["wheel"].origin[:3, 3], (-1, 2, 0.5), atol=1e-12)


def test_an_include_that_is_static_makes_the_model_around_it_static(tmp_path, shelf):
    def static(content):
        found = world(tmp_path, '<model name="m">%s</model>' % content, shelf)
        assert found.problems == []
        return found.models[0].static

    shelf.find("model://can").write_text(sdf('<static>true</static><link name="l"/>', name="can"))
    include = "<include><uri>model://can</uri>%s</include>"
    assert static(include % "")
    assert static("<model name='n'>%s</model>" % (include % ""))
    assert not static("<link name='k'/><model name='n'>%s</model>" % (include % ""))
    assert static(include % "" + "<static>false</static>")  # the first one counts
    assert not static("<static>false</static>" + include % "")
    assert not static(include % "<static>false</static>")


def test_includes_without_a_name_get_a_number(tmp_path, shelf):
    found = world(tmp_path, 3 * "<include><uri>model://can</uri></include>", shelf)
    assert [model.name for model in found.models] == [model.robot.name for model in found.models] == [
        "can", "can_0", "can_1"]
    found = world(tmp_path, '<model name="m">%s</model>' % (2 * "<include><uri>model://can</uri></include>"), shelf)
    assert list(found.models[0].robot.links) == ["can::l", "can_0::l"]


def test_names_may_have_the_models_own_in_front():
    model = read('<link name="a"><pose>1 0 0 0 0 0</pose></link>'
                 '<link name="b"><pose relative_to="m::a">0 2 0 0 0 0</pose></link>' + joint("j", "m::a", "m::b"))
    assert where(model.robot)["b"][:3, 3].tolist() == [1, 2, 0] and model.robot.joints["j"].parent == "a"


def test_collisions_of_a_link_keep_their_surfaces():
    shape = '<collision name="%s"><geometry><box><size>1 1 1</size></box></geometry>%s</collision>'
    surface = "<surface><friction><ode><mu>%s</mu></ode></friction></surface>"
    model = read('<link name="l">%s%s%s</link>' % (
        shape % ("a", surface % 0.2), shape % ("b", ""), shape % ("c", surface % 0.2)))
    body = merge_fixed(model.robot).links["l"]
    assert body.surface.friction == 0.2 and [shape.name for shape in body.own_collisions()] == ["a", "c"]
    (patch,) = body.patches
    assert patch.surface.friction is None and [shape.name for shape in patch.collisions] == ["b"]


def test_of_several_models_in_a_file_the_first_counts_as_in_gazebo(tmp_path):
    two = '<sdf version="1.6"><model name="%s"><link name="l"/></model><model name="b"><link name="k"/></model></sdf>'
    (tmp_path / "pair").mkdir()
    (tmp_path / "pair" / "model.sdf").write_text(two % "a", encoding="utf-8")
    found = world(tmp_path, "<include><uri>model://pair</uri></include>", ModelFolders([tmp_path]))
    spawned = parse_sdf_model(two % "a", "m.sdf")
    for model, warning in ((found.models[0], found.warning), (spawned, spawned.warning)):
        assert list(model.robot.links) == ["l"] and "<model> behind the first" in warning


@pytest.mark.parametrize("second, expected", [("", 0.004), (' default="true"', 0.002)])
def test_of_several_physics_the_first_or_the_default_counts(tmp_path, second, expected):
    profile = "<physics%s><max_step_size>%s</max_step_size></physics>"
    assert world(tmp_path, profile % ("", 0.004) + profile % (second, 0.002)).time_step_s == expected


def test_numbers_beyond_their_bounds_are_bounded(tmp_path):
    found = world(tmp_path, """<physics><max_step_size>0.1</max_step_size></physics>
<model name="m"><link name="a"><collision name="c"><geometry><sphere><radius>1</radius></sphere></geometry><surface>
<contact><ode><kp>-1</kp><kd>1e13</kd></ode></contact><bounce><threshold>0</threshold><restitution_coefficient>2</restitution_coefficient>
</bounce></surface></collision></link><link name="b"/>%s</model>""" % joint(
        "j", "a", "b", axis="<axis><xyz>0 0 0</xyz><limit><lower>1</lower><upper>-1</upper></limit>"
                            "<dynamics><damping>-0.5</damping><friction>-1</friction></dynamics></axis>"))
    assert found.problems == [] and found.time_step_s == 0.05
    for said in ("<max_step_size> of 0.1", "<kd> of 1e+13", "<kp> of -1", "of 2,", "zero", "lower limit 1", "of -1,"):
        assert said in found.warning
    robot = found.models[0].robot
    surface, hinge = robot.links["a"].surface, robot.joints["j"]
    assert (surface.stiffness, surface.damping, surface.restitution) == (0.0, 1e12, 1.0)
    assert (hinge.type, hinge.axis.tolist(), hinge.damping, hinge.friction) == ("continuous", [1, 0, 0], 0.5, 0.0)


@pytest.mark.parametrize(("contact", "bitmask"), [
    ("<collide_bitmask>0x06</collide_bitmask>", 6), ("<collide_bitmask>2</collide_bitmask>", 2),
    ("<collide_bitmask>65535</collide_bitmask>", None), ("<collide_bitmask>all</collide_bitmask>", None),
    ("<collide_without_contact>true</collide_without_contact>", 0)])
def test_a_surface_has_a_bitmask(contact, bitmask):
    found = parse_sdf_model(sdf("""<link name="a"><collision name="c"><geometry><sphere><radius>1</radius></sphere>
        </geometry><surface><friction><ode><mu>0.5</mu></ode></friction><contact>%s</contact></surface></collision>
        </link>""" % contact), "m.sdf")
    assert found.robot.links["a"].surface.bitmask == bitmask
    assert ("all" in contact) == ("collide_bitmask" in found.warning)


def test_a_joint_may_have_a_sensor():
    robot = read('<link name="a"/><link name="b"/>' + joint("j", "a", "b").replace(
        "</joint>", '<sensor name="ft" type="force_torque"><update_rate>10</update_rate></sensor></joint>')).robot
    (block,) = robot.gazebo
    assert block.get("reference") == "j" and block.find("sensor").get("name") == "ft"


def test_velocities_of_a_link_may_decay():
    found = parse_sdf_model(sdf('<link name="a"><velocity_decay><linear>0.1</linear></velocity_decay></link>'), "m.sdf")
    assert found.robot.links["a"].decay == (0.1, 0.0) and found.warning == ""


def test_links_may_collide_with_their_model():
    found = parse_sdf_model(sdf('<self_collide>1</self_collide><link name="a"/><link name="b"><self_collide>0'
                                "</self_collide></link>" + joint("j", "a", "b")), "m.sdf")
    assert {name: link.self_collide for name, link in found.robot.links.items()} == {"a": True, "b": False}
    assert found.warning == ""


def test_a_joint_may_have_a_spring():
    dynamics = ("<dynamics><friction>0.3</friction><spring_stiffness>12</spring_stiffness>"
                "<spring_reference>-0.4</spring_reference></dynamics>")
    found = parse_sdf_model(sdf('<link name="a"/><link name="b"/>' + joint(
        "j", "a", "b", axis="<axis><xyz>0 0 1</xyz>%s</axis>" % dynamics)), "m.sdf")
    hinge = found.robot.joints["j"]
    assert (hinge.friction, hinge.spring_stiffness, hinge.spring_reference, found.warning) == (0.3, 12.0, -0.4, "")


# -- errors ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("xml, message", [
    ("<sdf", "m.sdf is not well-formed XML.*line 1"),
    ("", "m.sdf is not well-formed XML"),
    ("<robot name='r'/>", "m.sdf is not an SDF: its root element is <robot>, expected <sdf>"),
    ("<sdf version='1.6'/>", "line 1: it holds nothing; expected one <model>"),
    ("<sdf version='new'/>", "version='new'"),
    (sdf(""), "model 'm' has no <link>"),
    (sdf("<link/>"), "line 3: <link> has no name"),
    (sdf('<link name="a"/><link name="a"/>'), "link 'a' appears twice"),
    (sdf('<link name="a"><pose>0 0 1 0</pose></link>'), "line 3: <pose> is '0 0 1 0', expected 6 numbers"),
    (sdf('<link name="a"><pose>0 0 1 0 0 nan</pose></link>'), "expected 6 numbers"),
    (sdf('<link name="a"><gravity>maybe</gravity></link>'), "<gravity> is 'maybe', expected true or false"),
    (sdf('<link name="a"><visual name="c"><geometry><sphere><radius>-1</radius></sphere></geometry></visual></link>'),
     "<radius> is '-1', expected positive"),
    (sdf('<link name="a"/>' + joint("j", "a", "b", "fixed")), "frame 'b' does not exist; frames: a, j"),
    (sdf('<link name="a"/>' + joint("j", "b", "a", "fixed")), "'j' names link 'b', which does not exist; links: a"),
    (sdf('<link name="a"><pose relative_to="b"/></link><link name="b"><pose relative_to="a">1 0 0 0 0 0</pose></link>'),
     "given relative to itself"),
])
def test_errors_name_file_line_and_what_is_right(xml, message):
    with pytest.raises(SdfError, match=message):
        parse_sdf_model(xml, "m.sdf")


def test_a_world_file_needs_a_world(tmp_path):
    path = tmp_path / "a.world"
    path.write_text("<sdf version='1.6'/>")
    with pytest.raises(SdfError, match="a.world, line 1: it holds 0 <world>, expected one"):
        parse_sdf_world(path)
    with pytest.raises(SdfError, match="b.world cannot be read"):
        parse_sdf_world(tmp_path / "b.world")


def test_core_loads_without_ros():
    block = "import sys; sys.modules.update(dict.fromkeys(('rospy', 'roslib', 'geometry_msgs'))); "
    subprocess.run([sys.executable, "-c", block + "import sdf_model"], check=True)


def test_a_heightmap_is_a_mesh_of_its_size_at_its_place():
    model = read("""<link name="l"><pose>0 0 2 0 0 0</pose><collision name="c"><geometry><heightmap>
<uri>model://hills/hills.png</uri><size>129 64 10</size><pos>1 2 3</pos></heightmap>
</geometry></collision></link>""")
    shape, = model.robot.links["l"].collisions
    assert shape.geometry == Mesh("model://hills/hills.png", (129, 64, 10)) and model.warning == ""
    assert shape.origin[:3, 3].tolist() == [1, 2, 3]


def test_names_in_a_nested_model_may_begin_with_all_models_around_it():
    """As in Gazebo's deeply_nested_models.world."""
    inner = "".join(LINK % (name, "0 0 0 0 0 0") for name in "ab") + joint("j", "o::m::n::a", "o::m::n::b")
    text = '<sdf version="1.6"><model name="o"><model name="m"><model name="n">%s</model></model></model></sdf>' % inner
    found = parse_sdf_model(text, "m.sdf").robot
    hinge = found.joints["m::n::j"]
    assert (hinge.parent, hinge.child) == ("m::n::a", "m::n::b")
    inner = LINK % ("a", "0 0 0 0 0 0")
    text = '<sdf version="1.6"><model name="m"><model name="m">%s</model>%s%s</model></sdf>' % (
        inner, inner, joint("j", "m::m::a", "a"))
    assert parse_sdf_model(text, "m.sdf").robot.joints["j"].parent == "m::a"


def test_a_shape_without_a_size_is_tiny_and_a_negative_one_is_refused():
    box = '<link name="l"><collision name="c"><geometry><box><size>%s</size></box></geometry></collision></link>'
    found = parse_sdf_model(sdf(box % "0 1 0"), "m.sdf")
    assert found.robot.links["l"].collisions[0].geometry.size == (1e-4, 1.0, 1e-4)
    assert "<size> of 0 1 0, of which 0.0001 is used for 0 (m.sdf line" in found.warning
    with pytest.raises(SdfError, match="-1"):
        parse_sdf_model(sdf(box % "1 1 -1"), "m.sdf")


# What sdformat reads; None: that its default is used.
@pytest.mark.parametrize("path, tag, text, expected", [
    ("collision/geometry/sphere", "radius", "2.5m", 2.5), ("collision/geometry/sphere", "radius", "2 3", 2.0),
    ("collision/geometry/sphere", "radius", "", 1.0), ("collision/geometry/sphere", None, "", 1.0),
    ("collision/geometry/sphere", "radius", "1e6", 1e4), ("collision/surface/friction/ode", "mu", "true", 1.0),
    ("collision/surface/friction/ode", "mu", "", None), ("inertial", "mass", "", 1.0), ("inertial", "mass", "0", 0.0),
    ("axis/limit", "lower", "-inf", None), ("axis/limit", "effort", "inf", None), ("axis/limit", "upper", "", None),
    ("axis/dynamics", "damping", "inf", 1e12), ("axis/dynamics", "damping", "", 0.0)])
def test_numbers_are_read_as_by_sdformat_with_a_note(path, tag, text, expected):
    inside = "<%s>%s</%s>" % (tag, text, tag) if tag else ""
    for part in reversed(path.split("/")):
        inside = "<%s>%s</%s>" % (part, inside, part)
    shape = '<geometry><sphere><radius>1</radius></sphere></geometry>'
    held = inside.replace("<collision>", '<collision name="c">' + shape * ("<surface>" in inside))
    hinge = joint("j", "a", "b", axis=inside.replace("<axis>", "<axis><xyz>0 0 1</xyz>") if path.startswith("axis")
                  else "<axis><xyz>0 0 1</xyz></axis>")
    found = parse_sdf_model(sdf('<link name="a">%s</link><link name="b"/>%s' % (
        "" if path.startswith("axis") else held, hinge)), "m.sdf")
    link, turns = found.robot.links["a"], found.robot.joints["j"]
    read = {"sphere": lambda: link.collisions[0].geometry.radius, "ode": lambda: link.surface and link.surface.friction,
            "inertial": lambda: link.inertial.mass, "limit": lambda: getattr(turns.limit, tag),
            "dynamics": lambda: turns.damping}
    assert read[path.split("/")[-1]]() == expected
    assert ("not as SDF has it, but read" in found.warning) == ("inf" not in text or tag == "damping")


