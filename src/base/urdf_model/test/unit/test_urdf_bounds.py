# SPDX-License-Identifier: BSD-3-Clause
"""Numbers out of bounds and endless descriptions are refused, with the bound in the message."""


import numpy as np
import pytest

from urdf_model import OutOfBounds, UrdfError, XmlRefused, bounds, parse_urdf, parse_xml

ROBOT = """<robot name="r"><link name="base"/><link name="tip">
  <inertial><origin xyz="0 0 0"/><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial>
  <collision><origin xyz="0 0 0"/><geometry><box size="1 1 1"/></geometry></collision>
  <visual><geometry><mesh filename="a.stl" scale="1 1 1"/></geometry></visual></link>
  <joint name="j" type="revolute"><parent link="base"/><child link="tip"/><origin xyz="0 0 0"/><axis xyz="0 0 1"/>
    <dynamics damping="0"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""
ALL = {name: value for name, value in vars(bounds).items() if isinstance(value, bounds.Bound)}


@pytest.mark.parametrize(
    "found, instead, message",
    [
        ('size="1 1 1"', 'size="1 1e30 1"', r"the size of the box in a collision of link 'tip' .line 1. is "
                                            r".1, 1e.30, 1. m; expected 1e-09 to 10000 m"),
        ('mass value="1"', 'mass value="1e308"', r"the mass of link 'tip' .* is 1e.308 kg; expected 0 to 1e.07 kg"),
        ('ixx="1"', 'ixx="1e308"', r"the inertia of link 'tip' .*expected -1e.12 to 1e.12 kg m"),
        ('<origin xyz="0 0 0"/><mass', '<origin xyz="0 0 1e8"/><mass', "the centre of mass of link 'tip'"),
        ('<collision><origin xyz="0 0 0"/>', '<collision><origin xyz="0 -1e308 0"/>', "the origin of a collision"),
        ('scale="1 1 1"', 'scale="1 1 1e30"', "the scale of the mesh in a visual of link 'tip'"),
        ('axis xyz="0 0 1"', 'axis xyz="0 0 1e200"', "axis of joint 'j' is 0 0 1e.200"),
        ('name="tip"', 'name="%s"' % ("t" * 501), "the name of a link has 501 letters"),
    ],
)
def test_what_no_world_holds_is_refused(found, instead, message):
    xml = ROBOT.replace("\n", " ")
    assert found in xml
    with pytest.raises(UrdfError, match=message):
        parse_urdf(xml.replace(found, instead).replace('link="tip"', 'link="%s"' % (
            "t" * 501 if "ttt" in instead else "tip")))


def test_limits_beyond_any_number_mean_none():
    robot = parse_urdf(ROBOT.replace('lower="-1" upper="1" effort="1" velocity="1"',
                                     'lower="-1e308" upper="1e16" effort="1e308" velocity="1e16"'))
    limit = robot.joints["j"].limit
    assert (limit.lower, limit.upper, limit.effort, limit.velocity) == (-1e12, 1e12, None, None)


def chain(count, kind):
    links = "".join("<link name='l%d'/>" % k for k in range(count + 1))
    return "<robot name='r'>%s%s</robot>" % (links, "".join(
        "<joint name='j%d' type='%s'><parent link='l%d'/><child link='l%d'/></joint>" % (k, kind, k - 1, k)
        for k in range(1, count + 1)))


@pytest.mark.parametrize("xml, message", [
    (chain(100_000, "fixed"), r"has 1\d{7} bytes; expected at most 4000000"),
    (chain(2_000, "fixed"), "2001 links are more than can be read in time; expected at most 2000"),
    (chain(122, "continuous"), "122 joints that move .* expected at most 121"),
    ("<robot name='r'><link name='l'/>%s</robot>" % ("<a/>" * 200_000), "elements; expected at most 100000"),
    ("<robot name='r'>%s<link name='l'/></robot>" % ("<a>" * 5000), "not well-formed"),
])
def test_a_description_has_an_end(xml, message):
    with pytest.raises(UrdfError, match=message):
        parse_urdf(xml)


def test_a_large_robot_is_none_too_many():
    assert len(parse_urdf(chain(121, "continuous")).movable_joints()) == 121
    assert len(parse_urdf(chain(1_500, "fixed")).links) == 1_501


def test_entity_bombs_are_refused():
    bomb = "<!DOCTYPE r [<!ENTITY a 'aaaaaaaaaa'>%s]><r>&e9;</r>" % "".join(
        "<!ENTITY e%d '%s'>" % (k, ("&e%d;" % (k - 1) if k else "&a;") * 10) for k in range(10))
    with pytest.raises(XmlRefused, match="declares the entities a, e0|entity reference loop"):
        parse_xml(bomb)


@pytest.mark.parametrize("name", sorted(ALL))
@pytest.mark.parametrize("value", [float("nan"), float("inf"), -float("inf"), 1e308, -1e308])
def test_no_bound_lets_absurd_numbers_in(name, value):
    with pytest.raises(OutOfBounds, match="expected"):
        ALL[name].check(value, "it")
    with pytest.raises(OutOfBounds, match="expected"):
        ALL[name].check(np.array([1.0, value]), "it")


@pytest.mark.parametrize("name", sorted(ALL))
def test_bounds_belong_to_what_they_bound_and_have_a_reason(name):
    bound = ALL[name]
    assert bound.check(bound.low, "it") == bound.low and bound.check(bound.high, "it") == bound.high
    assert len(bound.reason) > 10
