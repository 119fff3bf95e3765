# SPDX-License-Identifier: BSD-3-Clause
"""Every element of an SRDF, and the treatment of entries that cannot be used."""
import pytest

from motion_planning.srdf import DisabledPair, EndEffector, SrdfError, VirtualJoint, parse_srdf
from urdf_model import parse_urdf

URDF = """<robot name="two">
  <link name="base"/><link name="upper"/><link name="fore"/><link name="hand"/>
  <joint name="a" type="revolute"><parent link="base"/><child link="upper"/>
    <limit lower="-1" upper="1" effort="1" velocity="2"/></joint>
  <joint name="b" type="continuous"><parent link="upper"/><child link="fore"/></joint>
  <joint name="c" type="fixed"><parent link="fore"/><child link="hand"/></joint>
</robot>"""

ALL = """<robot name="two">
  <virtual_joint name="v" type="planar" parent_frame="odom" child_link="base"/>
  <group name="arm"><chain base_link="base" tip_link="hand"/></group>
  <group name="parts"><link name="upper"/><joint name="b"/></group>
  <group name="all"><group name="arm"/></group>
  <group name="gripper"><link name="hand"/></group>
  <group_state name="home" group="arm"><joint name="a" value="0.5"/><joint name="b" value="-1e-1"/></group_state>
  <end_effector name="tool" group="gripper" parent_link="fore" parent_group="arm"/>
  <passive_joint name="v"/><passive_joint name="b"/>
  <disable_collisions link1="base" link2="upper" reason="Adjacent"/>
  <enable_collisions link1="hand" link2="base"/>
  <disable_default_collisions link="hand"/>
  <joint_property joint_name="v" property_name="motion_model" value="diff_drive"/>
  <link_sphere_approximation link="hand"><sphere center="0 0 0.1" radius="0.2"/></link_sphere_approximation>
  <something_else/>
</robot>"""


@pytest.fixture
def robot():
    return parse_urdf(URDF)


def test_every_element_is_read(robot):
    srdf = parse_srdf(ALL, robot)
    assert srdf.warnings == []
    assert srdf.virtual_joints == [VirtualJoint("v", "planar", "odom", "base")]
    assert srdf.groups["arm"].chains == (("base", "hand"),)
    assert (srdf.groups["parts"].links, srdf.groups["parts"].joints) == (("upper",), ("b",))
    assert srdf.groups["all"].subgroups == ("arm",)
    assert (srdf.states[0].name, srdf.states[0].group, srdf.states[0].values) == ("home", "arm", {"a": 0.5, "b": -0.1})
    assert srdf.end_effectors == [EndEffector("tool", "gripper", "fore", "arm")]
    assert srdf.passive_joints == ["v", "b"]
    assert srdf.disabled == [DisabledPair("base", "upper", "Adjacent")]
    assert (srdf.enabled, srdf.no_default) == ([("hand", "base")], ["hand"])
    assert srdf.joint_properties == {"v": {"motion_model": "diff_drive"}}
    assert srdf.spheres == {"hand": (((0.0, 0.0, 0.1), 0.2),)}


@pytest.mark.parametrize("entry, words", [
    ('<virtual_joint name="v" type="hinge" parent_frame="w" child_link="base"/>', "type is 'hinge'"),
    ('<virtual_joint name="v" type="fixed" parent_frame="w" child_link="hand"/>', "root 'base'"),
    ('<virtual_joint name="v" type="fixed" child_link="base"/>', "no parent_frame"),
    ('<group name="g"><link name="nose"/></group>', "link 'nose' is not in the URDF"),
    ('<group name="g"><joint name="nose"/></group>', "joint 'nose' is not in the URDF"),
    ('<group name="g"><chain base_link="hand" tip_link="base"/></group>', "does not hang below"),
    ('<group name="g"><chain base_link="hand" tip_link="hand"/></group>', "holds no joint"),
    ('<group name="g"/>', "group 'g' is empty"),
    ('<group name="g"><group name="h"/></group>', "contains the group 'h'"),
    ('<group name="arm"><joint name="a"/></group>', "appears twice (first in line 2)"),
    ('<group_state name="s" group="nobody"><joint name="a" value="0"/></group_state>', "group 'nobody'"),
    ('<group_state name="s" group="arm"><joint name="a" value="x"/></group_state>', "value='x' is not a number"),
    ('<group_state name="s" group="arm"><joint name="a" value="nan"/></group_state>', "not finite"),
    ('<group_state name="s" group="arm"><joint name="a" value="1 2"/></group_state>', "takes one value, got 2"),
    ('<end_effector name="e" group="arm" parent_link="nose"/>', "link 'nose'"),
    ('<end_effector name="e" group="arm" parent_link="hand" parent_group="x"/>', "parent group 'x'"),
    ('<passive_joint name="nose"/>', "joint 'nose'"),
    ('<disable_collisions link1="base" link2="nose"/>', "link 'nose'"),
    ('<disable_collisions link1="base"/>', "no link2"),
    ('<link_sphere_approximation link="hand"><sphere center="0 0" radius="1"/></link_sphere_approximation>', "three"),
])
def test_what_cannot_be_used_is_named_with_its_line(robot, entry, words):
    text = '<robot name="two">\n<group name="arm"><joint name="a"/></group>\n\n%s\n</robot>' % entry
    srdf = parse_srdf(text, robot, source="two.srdf")
    assert srdf.warnings and words in srdf.warnings[0] and srdf.warnings[0].startswith("two.srdf, line 4: ")
    assert list(srdf.groups) == ["arm"]


def test_a_group_keeps_those_members_that_are_there(robot):
    srdf = parse_srdf('<robot name="two"><group name="g"><link name="nose"/><joint name="a"/></group></robot>', robot)
    assert srdf.groups["g"].joints == ("a",) and "left out of group 'g'" in srdf.warnings[0]


def test_groups_in_a_circle_are_dropped_and_those_that_name_them(robot):
    srdf = parse_srdf('<robot name="two"><group name="x"><group name="y"/></group><group name="y"><group name="x"/>'
                      '</group><group name="z"><group name="y"/></group><group name="ok"><joint name="a"/></group>'
                      '</robot>', robot)
    assert list(srdf.groups) == ["ok"] and len(srdf.warnings) == 3


@pytest.mark.parametrize("order", [1, -1])
def test_a_group_with_a_mobile_base_keeps_its_other_joints(robot, order):
    """As PR2's whole_body: a group of the virtual joint, one of that group, and one of it and an arm."""
    groups = ['<group name="base"><joint name="v"/></group>', '<group name="drive"><group name="base"/></group>',
              '<group name="arm"><joint name="a"/></group>',
              '<group name="body"><group name="drive"/><group name="arm"/><group name="base"/></group>']
    joint = '<virtual_joint name="v" type="planar" parent_frame="odom" child_link="base"/>'
    srdf = parse_srdf('<robot name="two">%s%s</robot>' % (joint, "".join(groups[::order])), robot)
    assert set(srdf.groups) == {"arm", "body"} and srdf.groups["body"].subgroups == ("arm",)
    for words in ("'v' is a virtual joint", "left out of group 'drive'", "left out of group 'body'"):
        assert any(words in warning for warning in srdf.warnings)


@pytest.mark.parametrize("text", [
    "", "<robot", "<sdf/>", "<!DOCTYPE r [<!ENTITY e 'x'>]><robot name='two'>&e;</robot>"])
def test_what_is_no_srdf_is_refused(robot, text):
    with pytest.raises(SrdfError):
        parse_srdf(text, robot)


def test_another_robots_name_is_a_warning(robot):
    assert "robot 'three'" in parse_srdf('<robot name="three"/>', robot).warnings[0]
