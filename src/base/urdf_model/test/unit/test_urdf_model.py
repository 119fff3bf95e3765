# SPDX-License-Identifier: BSD-3-Clause
"""The parser returns what the description says, and errors name the line."""

import math
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from urdf_model import Mesh, UrdfError, merge_fixed, parse_urdf
from urdf_model.merge import combine
from urdf_model.transforms import (
    axis_rotation,
    inverse,
    matrix_from_quaternion,
    pose_matrix,
    quaternion_from_matrix,
    rotation_angle,
    rpy_from_matrix,
    rpy_matrix,
)

ARM = """<?xml version="1.0"?>
<robot name="arm">
  <material name="red"><color rgba="1 0 0 1"/></material>
  <link name="base"/>
  <link name="plate">
    <inertial><origin xyz="0 0 0.1"/><mass value="2"/><inertia ixx="0.1" iyy="0.2" izz="0.3" ixy="0" ixz="0" iyz="0"/>
    </inertial>
  </link>
  <link name="upper">
    <inertial><origin xyz="0.5 0 0" rpy="0 0 1.5707963267948966"/><mass value="1"/>
      <inertia ixx="1" iyy="2" izz="3" ixy="0" ixz="0" iyz="0"/></inertial>
    <visual><geometry><mesh filename="package://arm/upper.dae" scale="1 2 3"/></geometry><material name="red"/></visual>
    <collision><origin xyz="0 0 0.2"/><geometry><box size="1 1 1"/></geometry></collision>
  </link>
  <link name="tool">
    <inertial><mass value="3"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><geometry><sphere radius="0.1"/></geometry></collision>
  </link>
  <link name="finger"/>
  <joint name="mount" type="fixed"><parent link="base"/><child link="plate"/><origin xyz="0 0 1"/></joint>
  <joint name="shoulder" type="revolute"><parent link="plate"/><child link="upper"/><origin xyz="0 0 0.5"/>
    <axis xyz="0 0 2"/><limit lower="-1" upper="1" effort="10" velocity="2"/><dynamics damping="0.7"/></joint>
  <joint name="wrist" type="fixed"><parent link="upper"/><child link="tool"/><origin xyz="1 0 0" rpy="0 1.5 0"/></joint>
  <joint name="grip" type="prismatic"><parent link="tool"/><child link="finger"/><limit lower="0" upper="0.02"
    effort="20" velocity="5"/><mimic joint="shoulder" multiplier="-1"/></joint>
  <transmission name="t"><type>transmission_interface/SimpleTransmission</type>
    <joint name="shoulder"><hardwareInterface>hardware_interface/EffortJointInterface</hardwareInterface></joint>
    <actuator name="m"><mechanicalReduction>50</mechanicalReduction></actuator></transmission>
  <gazebo reference="tool"><selfCollide>true</selfCollide></gazebo>
</robot>
"""


def test_core_loads_without_ros():
    """The package must import on a machine that has no ROS at all."""
    block = "import sys; sys.modules.update(dict.fromkeys(('rospy', 'roslib', 'geometry_msgs', 'pybullet'))); "
    subprocess.run([sys.executable, "-c", block + "import urdf_model"], check=True)


def test_parse_reads_everything():
    robot = parse_urdf(ARM)
    assert robot.name == "arm" and robot.root == "base" and robot.warnings == []
    assert [j.name for j in robot.movable_joints()] == ["shoulder", "grip"]
    shoulder = robot.joints["shoulder"]
    assert (shoulder.parent, shoulder.child) == ("plate", "upper")
    np.testing.assert_allclose(shoulder.axis, (0, 0, 1))
    limit = shoulder.limit
    assert (limit.lower, limit.upper, limit.effort, limit.velocity, shoulder.damping) == (-1, 1, 10, 2, 0.7)
    assert robot.joints["grip"].mimic.joint == "shoulder" and robot.joints["grip"].mimic.multiplier == -1
    visual = robot.links["upper"].visuals[0]
    assert visual.geometry == Mesh("package://arm/upper.dae", (1.0, 2.0, 3.0)) and visual.colour == (1, 0, 0, 1)
    transmission = robot.transmissions[0]
    assert transmission.joints[0].hardware_interfaces == ("hardware_interface/EffortJointInterface",)
    assert transmission.reductions == (50.0,)
    assert robot.gazebo[0].get("reference") == "tool"
    # The inertial frame is turned by 90 degrees about z: its x moment stands along the link's y axis.
    np.testing.assert_allclose(np.diag(robot.links["upper"].inertial.inertia), (2, 1, 3), atol=1e-12)


def test_chain_goes_from_base_to_tip():
    robot = parse_urdf(ARM)
    assert [j.name for j in robot.chain("base", "finger")] == ["mount", "shoulder", "wrist", "grip"]
    with pytest.raises(UrdfError, match="no link 'hand'; its links are base, finger"):
        robot.chain("base", "hand")
    with pytest.raises(UrdfError, match="does not hang below"):
        robot.chain("tool", "plate")


def test_merge_keeps_mass_moments_and_frames():
    robot = parse_urdf(ARM)
    merged = merge_fixed(robot)
    assert list(merged.links) == ["base", "upper", "finger"] and list(merged.joints) == ["shoulder", "grip"]
    assert merged.joints["shoulder"].parent == "base" and merged.joints["grip"].parent == "upper"
    np.testing.assert_allclose(merged.joints["shoulder"].origin[:3, 3], (0, 0, 1.5))
    frame = merged.frames["tool"]
    assert frame.link == "upper"
    np.testing.assert_allclose(frame.offset, robot.joints["wrist"].origin)
    upper = merged.links["upper"].inertial
    assert upper.mass == 4.0
    np.testing.assert_allclose(upper.centre, ((0.5 + 3.0) / 4.0, 0, 0))
    # Parallel axes by hand: 1 kg at 0.5 m and 3 kg at 1 m, both on the x axis.
    expected_zz = 3.0 + 0.01 + 1.0 * (0.875 - 0.5) ** 2 + 3.0 * (1.0 - 0.875) ** 2
    assert upper.inertia[2, 2] == pytest.approx(expected_zz)
    assert [s.link for s in merged.links["upper"].collisions] == ["upper", "tool"]
    np.testing.assert_allclose(merged.links["upper"].collisions[1].origin, frame.offset)


def test_merge_turns_the_moments_of_a_turned_part():
    """The tool is turned by 90 degrees about y: its z moment is about the body's x axis, on which both centres lie."""
    turned = ARM.replace('rpy="0 1.5 0"', 'rpy="0 1.5707963267948966 0"').replace(
        'ixx="0.01" iyy="0.01" izz="0.01"', 'ixx="4" iyy="5" izz="6"')
    assert merge_fixed(parse_urdf(turned)).links["upper"].inertial.inertia[0, 0] == pytest.approx(2.0 + 6.0)


point_masses = st.tuples(st.floats(0.01, 10), st.lists(st.floats(-1, 1), min_size=3, max_size=3))


@given(st.lists(point_masses, min_size=2, max_size=6))
def test_combining_point_masses_is_independent_of_order(parts):
    points = [(mass, np.array(centre), np.zeros((3, 3))) for mass, centre in parts]
    one, two = combine(points), combine(points[::-1])
    np.testing.assert_allclose(one.centre, two.centre, atol=1e-12)
    np.testing.assert_allclose(one.inertia, two.inertia, atol=1e-9)
    assert np.linalg.eigvalsh(one.inertia)[0] > -1e-9


def edit(old, new):
    assert old in ARM
    return ARM.replace(old, new, 1)


@pytest.mark.parametrize(
    "xml, message",
    [
        ("", "not well-formed XML"),
        ("<robot", "not well-formed XML"),
        ("<sdf/>", "root element is <sdf>, expected <robot>"),
        ("<robot name='r'/>", "has no <link>"),
        (edit('<link name="base"/>', '<link name="base"/><link name="base"/>'), "line 4: link 'base' appears twice"),
        (edit('<link name="base"/>', "<link/>"), "<link> has no name"),
        (edit('<child link="plate"/>', '<child link="plank"/>'), "child link 'plank', which does not exist"),
        (edit('type="revolute"', 'type="hinge"'), "type 'hinge'; known: revolute, continuous"),
        (edit('<limit lower="-1" upper="1" effort="10" velocity="2"/>', ""), "revolute joint 'shoulder' has no <limit"),
        (edit("</robot>", '<link name="spare"/></robot>'), "2 root links: base, spare"),
        (
            "<robot name='r' xmlns:xacro='http://www.ros.org/wiki/xacro'><xacro:include filename='x'/></robot>",
            "run it through xacro first",
        ),
    ],
)
def test_what_is_wrong_is_said(xml, message):
    with pytest.raises(UrdfError) as raised:
        parse_urdf(xml, source="arm.urdf")
    assert message in str(raised.value) and "arm.urdf" in str(raised.value)


def test_entities_are_refused():
    bomb = "<!DOCTYPE r [<!ENTITY a SYSTEM 'file:///etc/passwd'>]><robot name='r'><link name='l'/>&a;</robot>"
    with pytest.raises(UrdfError, match="declares the entity a"):
        parse_urdf(bomb)


@pytest.mark.parametrize(
    "xml, message",
    [
        (edit('ixx="1"', 'ixx="-1"'), "negative principal moment"),
        (edit('type="fixed"><parent link="upper"', 'type="floating"><parent link="upper"'), "moves freely"),
    ],
)
def test_what_can_be_mended_is_a_warning(xml, message):
    assert any(message in warning for warning in parse_urdf(xml).warnings)


@pytest.mark.parametrize("text", ["fifty", "", "nan", "2,5"])
def test_a_reduction_that_is_no_number_leaves_the_robot_alone(text):
    robot = parse_urdf(edit("<mechanicalReduction>50<", "<mechanicalReduction>%s<" % text))
    assert robot.transmissions[0].reductions == (1.0,) and robot.warnings == []


def test_a_transmission_whose_joint_has_no_name_leaves_the_robot_alone():
    robot = parse_urdf(edit('<joint name="shoulder"><hard', "<joint><hard"))
    assert robot.transmissions[0].joints[0].name == "" and robot.warnings == []


angles = st.floats(-math.pi, math.pi)


@given(angles, angles, angles)
def test_quaternions_and_matrices_are_the_same_rotation(roll, pitch, yaw):
    rotation = rpy_matrix(roll, pitch, yaw)
    about_fixed_axes = axis_rotation((0, 0, 1), yaw) @ axis_rotation((0, 1, 0), pitch) @ axis_rotation((1, 0, 0), roll)
    np.testing.assert_allclose(rotation, about_fixed_axes, atol=1e-12)
    quaternion = quaternion_from_matrix(rotation)
    assert quaternion @ quaternion == pytest.approx(1.0) and quaternion[3] >= 0.0
    np.testing.assert_allclose(matrix_from_quaternion(quaternion), rotation, atol=1e-12)


@given(angles, angles, angles)
def test_roll_pitch_and_yaw_come_back_as_the_same_rotation(roll, pitch, yaw):
    rotation = rpy_matrix(roll, pitch, yaw)
    np.testing.assert_allclose(rpy_matrix(*rpy_from_matrix(rotation)), rotation, atol=1e-8)


def test_roll_is_zero_where_pitch_is_a_right_angle():
    assert rpy_from_matrix(rpy_matrix(0.3, math.pi / 2, 1.0)) == pytest.approx((0.0, math.pi / 2, 0.7))


@given(st.floats(0, math.pi))
def test_rotation_angle_is_the_angle(angle):
    assert rotation_angle(axis_rotation((0.6, 0.0, 0.8), angle)) == pytest.approx(angle, abs=1e-9)


def test_inverse_undoes():
    pose = pose_matrix((1, 2, 3), (0.1, 0.2, 0.3))
    np.testing.assert_allclose(inverse(pose) @ pose, np.eye(4), atol=1e-12)


@pytest.mark.parametrize("quaternion", [(0, 0, 0, 0), (math.nan, 0, 0, 1), (math.inf, 0, 0, 1)])
def test_a_quaternion_without_direction_is_refused(quaternion):
    with pytest.raises(ValueError, match="not a rotation"):
        matrix_from_quaternion(quaternion)


@pytest.mark.parametrize(("flag", "implicit"), [
    ("<implicitSpringDamper>1</implicitSpringDamper>", True), ("<cfmDamping>true</cfmDamping>", True),
    ("<implicitSpringDamper>false</implicitSpringDamper>", False), ("", False)])
def test_damping_may_be_implicit(flag, implicit):
    robot = parse_urdf("""<robot name="r"><link name="a"/><link name="b"/><joint name="j" type="continuous">
    <parent link="a"/><child link="b"/><dynamics damping="0.4"/></joint>
    <gazebo reference="j">%s</gazebo><gazebo reference="j"><provideFeedback>1</provideFeedback></gazebo>
    </robot>""" % flag)
    assert robot.joints["j"].implicit_damping is implicit
    assert merge_fixed(robot).joints["j"].implicit_damping is implicit


def test_a_damping_factor_is_a_decay_of_both_velocities():
    robot = parse_urdf('<robot name="r"><link name="a"/><gazebo reference="a"><dampingFactor>0.1</dampingFactor>'
                       "</gazebo></robot>")
    assert merge_fixed(robot).links["a"].decay == (0.1, 0.1)


def test_a_link_may_have_a_bitmask():
    robot = parse_urdf("""<robot name="r"><link name="a"/><gazebo reference="a"><collision><surface><contact>
    <collide_bitmask>0x02</collide_bitmask></contact></surface></collision></gazebo></robot>""")
    assert robot.links["a"].surface.bitmask == 2


def test_links_may_collide_with_their_model():
    robot = parse_urdf("""<robot name="r"><link name="a"/><link name="b"/><joint name="j" type="continuous">
    <parent link="a"/><child link="b"/></joint><gazebo reference="b"><selfCollide>false</selfCollide></gazebo>
    <gazebo><self_collide>true</self_collide></gazebo></robot>""")
    assert {name: link.self_collide for name, link in merge_fixed(robot).links.items()} == {"a": True, "b": False}


def test_a_joint_may_have_a_spring():
    robot = parse_urdf("""<robot name="r"><link name="a"/><link name="b"/><joint name="j" type="continuous">
    <parent link="a"/><child link="b"/></joint><gazebo reference="j"><springStiffness>12</springStiffness>
    <springReference>-0.4</springReference></gazebo></robot>""")
    joint = merge_fixed(robot).joints["j"]
    assert (joint.spring_stiffness, joint.spring_reference, robot.warnings) == (12.0, -0.4, [])


WRITTEN_BOTH_WAYS = """<robot name="r"><link name="a"><visual><geometry><sphere radius="1"/></geometry></visual></link>
<link name="b"/><joint name="j" type="fixed"><parent link="a"/><child link="b"/></joint>
<gazebo reference="a">%s</gazebo><gazebo reference="j">%s</gazebo></robot>"""


@pytest.mark.parametrize("form", ["<%s>%s</%s>", '<%s value="%s"/>'])
def test_elements_of_gazebo_may_have_their_content_in_an_attribute(form):
    def written(**elements):
        return "".join(form % ((tag, text, tag)[:form.count("%s")]) for tag, text in elements.items())

    robot = parse_urdf(WRITTEN_BOTH_WAYS % (
        written(mu1=0.5, mu2=0.1, fdir1="0 0 2", kp=7, selfCollide="true", turnGravityOff="true", dampingFactor=0.1,
                material="Gazebo/Red"), written(preserveFixedJoint="true", implicitSpringDamper="1")))
    link, joint = robot.links["a"], robot.joints["j"]
    surface = link.surface
    assert robot.warnings == []
    assert (surface.friction, surface.friction_across, surface.direction, surface.stiffness) == (
        0.5, 0.1, (0.0, 0.0, 1.0), 7.0)
    assert (link.self_collide, link.gravity, link.decay) == (True, False, (0.1, 0.1))
    assert link.visuals[0].colour is not None
    assert joint.preserved and joint.implicit_damping


@pytest.mark.parametrize("mu", ["inf", "Inf", "-1"])
def test_a_friction_without_a_bound_is_infinite(mu):
    robot = parse_urdf('<robot name="r"><link name="l"/><gazebo reference="l"><mu1>%s</mu1></gazebo></robot>' % mu)
    assert robot.links["l"].surface.friction == math.inf


def test_a_contact_may_be_rigid():
    robot = parse_urdf('<robot name="r"><link name="l"/><gazebo reference="l"><kp>Inf</kp></gazebo></robot>')
    assert robot.links["l"].surface.stiffness == math.inf


@pytest.mark.parametrize("tag, text, used", [("mu1", "nan", None), ("kp", "-1", 0.0), ("kd", "inf", None)])
def test_a_number_of_a_surface_that_means_nothing_is_a_warning(tag, text, used):
    robot = parse_urdf('<robot name="r"><link name="l"/><gazebo reference="l"><%s>%s</%s></gazebo></robot>'
                       % (tag, text, tag))
    assert tag in robot.warnings[0]
    surface = robot.links["l"].surface
    assert surface is None if used is None else surface.stiffness == used
