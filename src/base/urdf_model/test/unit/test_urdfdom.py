# SPDX-License-Identifier: BSD-3-Clause
"""The parser accepts what urdfdom accepts, with its repairs and a warning; Debian's check_urdf is the oracle."""

import math
import shutil
import subprocess

import pytest

from urdf_model import UrdfError, merge_fixed, parse_urdf

MASS = '<mass value="1"/>'
INERTIAL = '<inertial>%s<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>' % MASS
LIMIT = '<limit lower="-1" upper="1" effort="1" velocity="1"/>'
JOINT = '<joint name="j" type="revolute"><parent link="a"/><child link="b"/>%s</joint>'
BOX = '<geometry><box size="1 1 1"/></geometry>'
START = '<robot name="r">'


def robot(*, visual=None, collision=None, inertial=INERTIAL, more="", joint='<axis xyz="0 0 1"/>' + LIMIT):
    """A robot of two links; ``joint``: the content of the joint between them, or whole joints."""
    shapes = "".join("<%s>%s</%s>" % (tag, inside, tag)
                     for tag, inside in (("visual", visual), ("collision", collision)) if inside is not None)
    joints = joint if joint.startswith("<joint") else JOINT % joint
    return '%s<link name="a">%s%s</link><link name="b">%s</link>%s%s</robot>' % (
        START, inertial, shapes, INERTIAL, joints, more)


def shape(inside):
    return robot(collision="<geometry>%s</geometry>" % inside)


def block(inside):
    return robot(more='<gazebo reference="a">%s</gazebo>' % inside)


def limited(limit):
    return robot(joint=limit)


def typed(kind, inside=LIMIT):
    return robot(joint=(JOINT % inside).replace("revolute", kind))


# Name -> (URDF, what the warning must hold): urdfdom accepts it. "" where nothing is repaired.
ACCEPTED = {
    "material in geometry": (shape('<box size="1 1 1"/><material name="grey"/>'), "<material>"),
    "two shapes": (shape('<box size="1 1 1"/><sphere radius="1"/>'), "<sphere>"),
    "empty geometry": (shape(""), "no shape"),
    "no geometry": (robot(visual=""), "no <geometry>"),
    "unknown shape": (shape('<capsule radius="1" length="1"/>'), "<capsule>"),
    "material before the shape": (shape('<material name="m"/><box size="1 1 1"/>'), "<material>"),
    "plane": (shape('<plane normal="0 0 1"/>'), "<plane>"),
    "zero box": (shape('<box size="0 0 0"/>'), "0 0 0"),
    "flat box": (robot(visual='<geometry><box size="1 1 0"/></geometry>'), "1 1 0"),
    "cylinder of radius 0": (shape('<cylinder radius="0" length="1"/>'), "radius"),
    "negative cylinder": (shape('<cylinder radius="-0.1" length="1"/>'), "-0.1"),
    "ball without a radius": (shape("<sphere/>"), "no radius"),
    "mesh without a name": (shape("<mesh/>"), "no filename"),
    "mesh with an empty name": (shape('<mesh filename=""/>'), "empty filename"),
    "scale of one number": (shape('<mesh filename="a.stl" scale="0.001"/>'), "1 numbers"),
    "scale with commas": (shape('<mesh filename="a.stl" scale="1,1,1"/>'), "scale='1,1,1'"),
    "origin of two numbers": (robot(visual='<origin xyz="0 0"/>' + BOX), "2 numbers"),
    "origin with commas": (robot(visual='<origin xyz="0,0,0"/>' + BOX), "0,0,0"),
    "origin of four numbers": (robot(visual='<origin xyz="0 0 0 0"/>' + BOX), "4 numbers"),
    "empty origin": (robot(visual='<origin xyz=""/>' + BOX), "0 numbers"),
    "text as an angle": (robot(visual='<origin rpy="0 pi/2 0"/>' + BOX), "pi/2"),
    "visual's material without a name": (robot(visual=BOX + '<material><color rgba="1 0 0 1"/></material>'), "no name"),
    "mass without a value": (robot(inertial=INERTIAL.replace(MASS, "<mass/>")), "no value"),
    "no mass": (robot(inertial=INERTIAL.replace(MASS, "")), "no <mass>"),
    "mass with a unit": (robot(inertial=INERTIAL.replace('"1"/>', '"1kg"/>', 1)), "1kg"),
    "negative mass": (robot(inertial=INERTIAL.replace('"1"/>', '"-1"/>', 1)), "-1 kg"),
    "no inertia": (robot(inertial="<inertial>%s</inertial>" % MASS), "ixx"),
    "no ixy": (robot(inertial=INERTIAL.replace('ixy="0"', "")), "ixy"),
    "two inertials": (robot(inertial=2 * INERTIAL), "<inertial>"),
    "no lower limit": (limited('<limit effort="1" velocity="1"/>'), ""),
    "limits the wrong way round": (limited('<limit lower="1" upper="-1" effort="1" velocity="1"/>'), "lower limit 1"),
    "negative effort": (limited(LIMIT.replace('effort="1"', 'effort="-1"')), "effort"),
    "negative velocity": (limited(LIMIT.replace('velocity="1"', 'velocity="-1"')), "velocity"),
    "zero axis": (robot(joint='<axis xyz="0 0 0"/>' + LIMIT), "zero"),
    "long axis": (robot(joint='<axis xyz="0 0 5"/>' + LIMIT), ""),
    "no axis": (robot(joint=LIMIT), ""),
    "axis without xyz": (robot(joint="<axis/>" + LIMIT), ""),
    "mimics nothing": (robot(joint='<mimic joint="zz"/>' + LIMIT), "zz"),
    "mimics itself": (robot(joint='<mimic joint="j"/>' + LIMIT), ""),
    "negative damping": (robot(joint='<dynamics damping="-1" friction="-1"/>' + LIMIT), "damping"),
    "damping of 1e15": (robot(joint='<dynamics damping="1e15" friction="1e15"/>' + LIMIT), "damping"),
    "material without a colour": (robot(more='<material name="m"/>'), "'m'"),
    "material without a name": (robot(more='<material><color rgba="1 0 0 1"/></material>'), "name"),
    "colour of three numbers": (robot(more='<material name="m"><color rgba="1 0 0"/></material>'), "3 numbers"),
    "colour of bytes": (robot(visual=BOX + '<material name="m"><color rgba="255 0 0 1"/></material>'), "255"),
    "colour without numbers": (robot(visual=BOX + '<material name="m"><color/></material>'), "no rgba"),
    "texture without a file": (robot(more='<material name="m"><texture/><color rgba="1 0 0 1"/></material>'), "file"),
    "number with underscores": (robot(inertial=INERTIAL.replace('"1"/>', '"1_000"/>', 1)), "1_000"),
    "colour in words": (robot(visual=BOX + '<material name="m"><color rgba="red"/></material>'), "red"),
    "material that is not there": (robot(visual=BOX + '<material name="nope"/>'), "nope"),
    "unknown element": (robot(more="<foo/>"), ""),
    "child of two joints": (robot(joint=JOINT % LIMIT + (JOINT % LIMIT).replace('"j"', '"k"')), "'j' is left out"),
    "loop beside the tree": (robot(more='<link name="c"/><link name="d"/>' + "".join(
        (JOINT % LIMIT).replace('"j"', '"%s"' % n).replace('"a"', '"%s"' % p).replace('"b"', '"%s"' % c)
        for n, p, c in (("x", "c", "d"), ("y", "d", "c")))), "'x'"),
    "xacro is left": (robot(more='<xacro:include filename="x"/>').replace(
        START, START[:-1] + ' xmlns:xacro="http://www.ros.org/wiki/xacro">'), "xacro"),
    "xacro without its name space": (robot(more='<xacro:include filename="x"/>'), "xacro"),
    "comment": (shape('<!-- x --><box size="1 1 1"/>'), ""),
    "text": (robot(collision="words " + BOX), ""),
    "blank line first": ('\n<?xml version="1.0"?>' + robot(), ""),
    "byte order mark": ("\ufeff" + robot(), ""),
    "pose in a link": (robot(inertial=INERTIAL + "<pose>0 0 0 0 0 0</pose>"), ""),
    "gazebo without a reference": (robot(more="<gazebo><static>true</static></gazebo>"), ""),
    "gazebo of another link": (robot(more='<gazebo reference="c"><mu1>1</mu1></gazebo>'), ""),
    "gazebo of an argument": (robot(more='<gazebo reference="$(arg x)"/>'), ""),
    "empty friction": (block("<mu1/>"), "<mu1>"),
    "friction in words": (block("<mu1>high</mu1>"), "high"),
    "stiff contact": (block("<kp>1e+18</kp><kd>1e+15</kd>"), "<kd>"),
    "negative contact damping": (block("<kd>-1</kd>"), "<kd>"),
    "planar joint": (typed("planar"), "freely"),
    "floating joint": (typed("floating", ""), "freely"),
    "transmission without a joint": (robot(more='<transmission name="t"><type>x</type></transmission>'), ""),
    "two origins": (robot(visual='<origin xyz="1 0 0"/><origin xyz="2 0 0"/>' + BOX), ""),
    "no mass and no inertia": (robot(inertial=INERTIAL.replace('"1"', '"0"')), ""),
    "tiny mass": (robot(inertial=INERTIAL.replace('"1"/>', '"1e-12"/>', 1)), ""),
    "great mass": (robot(inertial=INERTIAL.replace('"1"/>', '"1e6"/>', 1)), ""),
    "tiny inertia": (robot(inertial=INERTIAL.replace('="1"', '="1e-12"')), ""),
    "fast joint": (limited(LIMIT.replace('velocity="1"', 'velocity="1e6"')), ""),
    "rough joint": (robot(joint='<dynamics damping="1e9" friction="1e9"/>' + LIMIT), ""),
}
# Name -> (URDF, what the error must hold): urdfdom refuses it, and so do we.
REFUSED = {
    "unknown type": (typed("ball"), "ball"),
    "empty type": (typed(""), "type ''"),
    "no type": (robot(joint=(JOINT % LIMIT).replace(' type="revolute"', "")), "type"),
    "joint without a name": (robot(joint=(JOINT % LIMIT).replace(' name="j"', "")), "no name"),
    "revolute without a limit": (typed("revolute", ""), "<limit"),
    "prismatic without a limit": (typed("prismatic", ""), "<limit"),
    "endless effort": (limited(LIMIT.replace('effort="1"', 'effort="1e400"')), "1e400"),
    "infinite limits": (limited(LIMIT.replace("-1", "-inf")), "-inf"),
    "effort with a unit": (limited(LIMIT.replace('effort="1"', 'effort="100N"')), "100N"),
    "empty damping": (robot(joint='<dynamics damping=""/>' + LIMIT), "damping"),
    "empty multiplier": (robot(joint='<mimic joint="j" multiplier=""/>' + LIMIT), "multiplier"),
    "joint's origin of two numbers": (robot(joint='<origin xyz="0 0"/>' + LIMIT), "2 numbers"),
    "two links of a name": (robot(more='<link name="a"/>'), "'a' appears twice"),
    "two joints of a name": (robot(joint=2 * (JOINT % LIMIT)), "'j' appears twice"),
    "two roots": (robot(more='<link name="z"/>'), "2 root links"),
    "link without a name": (robot(more="<link/>"), "no name"),
    "child that is not there": (robot(joint=(JOINT % LIMIT).replace('"b"', '"q"')), "'q'"),
    "only macros": ('<robot name="r" xmlns:xacro="x"><xacro:x/></robot>', "xacro"),
}


@pytest.mark.parametrize("name", ACCEPTED)
def test_what_urdfdom_accepts_is_accepted_with_one_warning(name):
    urdf, said = ACCEPTED[name]
    warnings = parse_urdf(urdf, source="arm.urdf").warnings
    about = [text for text in warnings if said in text]
    assert len(about) == 1 if said else not warnings
    assert all(text.startswith("arm.urdf, line 1: ") for text in warnings)


@pytest.mark.parametrize("name", REFUSED)
def test_what_urdfdom_refuses_is_refused(name):
    urdf, said = REFUSED[name]
    with pytest.raises(UrdfError, match="arm.urdf") as raised:
        parse_urdf(urdf, source="arm.urdf")
    assert said in str(raised.value)


def test_the_tables_are_those_of_check_urdf(tmp_path):
    if shutil.which("check_urdf") is None:
        pytest.skip("check_urdf is not installed; it is in Debian's liburdfdom-tools")
    for table in (ACCEPTED, REFUSED):
        for name, (urdf, _) in table.items():
            (tmp_path / (name + ".urdf")).write_text(urdf, encoding="utf-8")
    # Its return value is that of the last file alone.
    script = 'for file in *.urdf; do check_urdf "$file" >/dev/null 2>&1 && echo "${file%.urdf}"; done; true'
    told = subprocess.run(["bash", "-c", script], cwd=tmp_path, capture_output=True, text=True, check=True, timeout=120)
    assert set(told.stdout.splitlines()) == set(ACCEPTED)


def test_a_link_is_read_up_to_what_cannot_be_read():
    good, bad = "<visual>%s</visual>" % BOX, "<visual><geometry/></visual>"
    link = parse_urdf('<robot name="r"><link name="a"><collision>%s</collision>%s%s%s%s</link></robot>'
                      % (BOX, INERTIAL, good, bad, good)).links["a"]
    assert len(link.visuals) == 1 and link.collisions == [] and link.inertial.mass == 1.0


def test_repairs_are_those_of_urdfdom_and_ode():
    def one(name):
        return parse_urdf(ACCEPTED[name][0])

    joint = one("limits the wrong way round").joints["j"]
    assert joint.limit.lower < -1e6 and joint.limit.upper > 1e6
    assert one("zero axis").joints["j"].axis.tolist() == [1.0, 0.0, 0.0]
    assert (one("negative damping").joints["j"].damping, one("negative damping").joints["j"].friction) == (1.0, 0.0)
    assert one("negative effort").joints["j"].limit.effort is None
    assert list(one("child of two joints").joints) == ["k"]
    assert list(one("loop beside the tree").links) == ["a", "b"]
    assert one("mimics nothing").joints["j"].mimic is None
    assert one("colour of bytes").links["a"].visuals[0].colour is None
    assert one("no mass").links["a"].inertial.mass == 0.0
    assert one("negative cylinder").links["a"].collisions[0].geometry.radius == 0.1


def surface_of(*blocks):
    return parse_urdf('<robot name="r"><link name="l"/>%s</robot>' % "".join(
        '<gazebo reference="l">%s</gazebo>' % inside for inside in blocks)).links["l"]


def test_blocks_add_up():
    link = surface_of("<turnGravityOff>true</turnGravityOff>", "<mu1>0.05</mu1><kp>5</kp>", "<kp>1e6</kp><kd>1</kd>",
                      "<material>Gazebo/Red</material>")
    assert not link.gravity
    assert (link.surface.friction, link.surface.stiffness, link.surface.damping) == (0.05, 1e6, 1.0)
    assert surface_of("<mu1>0.1</mu1>", "<mu1>0.2</mu1>").surface.friction == 0.2
    assert surface_of("<mu1>-1</mu1>").surface.friction == math.inf
    assert surface_of("<collision><surface><friction><ode><mu>0.3</mu></ode></friction></surface></collision>"
                      ).surface.friction == 0.3


# Blocks of the links base, b and c, which Gazebo lumps together: what its one link has.
@pytest.mark.parametrize("blocks, field, expected", [
    ({"c": "<turnGravityOff>true</turnGravityOff>"}, "gravity", False),
    ({"c": "<gravity>false</gravity>", "b": "<gravity>true</gravity>"}, "gravity", False),
    ({"base": "<turnGravityOff>1</turnGravityOff>", "b": "<turnGravityOff>0</turnGravityOff>"}, "gravity", True),
    ({"c": "<dampingFactor>0.3</dampingFactor>"}, "decay", (0.3, 0.3)),
    ({"b": "<selfCollide>true</selfCollide>", "c": "<selfCollide>false</selfCollide>"}, "self_collide", False),
    ({"c": "<selfCollide>true</selfCollide>"}, "self_collide", True)])
def test_blocks_of_lumped_links_are_those_of_the_whole_link(blocks, field, expected):
    def merged(more=""):
        links = "".join('<link name="%s">%s</link>' % (name, INERTIAL) for name in ("c", "b", "base"))
        joints = "".join('<joint name="to_%s" type="fixed"><parent link="%s"/><child link="%s"/></joint>'
                         % (child, parent, child) for parent, child in (("base", "b"), ("b", "c")))
        said = "".join('<gazebo reference="%s">%s</gazebo>' % item for item in blocks.items())
        return merge_fixed(parse_urdf('<robot name="r">%s%s%s%s</robot>' % (links, joints, said, more))).links["base"]

    assert getattr(merged(), field) == expected
    # Links that stay have their own.
    kept = merged('<gazebo reference="to_b"><preserveFixedJoint>1</preserveFixedJoint></gazebo>')
    if field == "gravity" and not expected:
        assert kept.gravity and kept.weightless.mass == 2.0
    elif field == "decay":
        assert kept.decay == pytest.approx((0.2, 0.2))


@pytest.mark.parametrize("inside, weight", [
    ("<gravity>0</gravity>", False), ("<gravity>false</gravity>", False), ("<gravity>1</gravity>", True),
    ("<turnGravityOff>yes</turnGravityOff>", False), ("<turnGravityOff/>", False),
    ("<turnGravityOff>False</turnGravityOff>", True), ("<turnGravityOff>0</turnGravityOff>", True)])
def test_a_block_says_whether_a_link_has_weight(inside, weight):
    assert surface_of(inside).gravity is weight
