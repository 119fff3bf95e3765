# SPDX-License-Identifier: BSD-3-Clause
"""Limits: how they change commands, and where they are read from."""
import math

import numpy as np
import pytest

from controller_manager import EFFORT, POSITION, HardwareError
from controller_manager.limits import (
    EffortLimiter,
    JointLimits,
    PositionLimiter,
    SoftLimits,
    VelocityLimiter,
    limits_from_urdf,
    with_parameters,
    without_idle_soft_limits,
)
from controller_manager.transmissions import read_soft_limits, read_transmissions
from urdf_model import parse_urdf

DT = 0.1
HARD = JointLimits(lower=-1.0, upper=1.0, velocity=2.0, effort=10.0)
SOFT = JointLimits(lower=-1.0, upper=1.0, velocity=2.0, effort=10.0, soft=SoftLimits(-0.8, 0.8, 5.0, 4.0))


def limiter(kind, *limits):
    return kind(list(limits))


def enforce(limiter, command, position=0.0, velocity=0.0):
    count = len(limiter._columns.lower)
    return limiter.enforce(*(np.full(count, float(x)) if np.isscalar(x) else np.array(x, dtype=float)
                             for x in (command,)), DT, np.full(count, float(position)), np.full(count, float(velocity)))


# -- position -------------------------------------------------------------------------------------------------------


def test_position_counts_from_the_measured_one_first_and_then_from_its_own():
    position = limiter(PositionLimiter, HARD)
    assert enforce(position, 9.0, position=0.3) == pytest.approx([0.5])
    assert enforce(position, 9.0, position=0.0) == pytest.approx([0.7]), "open loop"
    position.reset()
    assert enforce(position, 9.0, position=0.0) == pytest.approx([0.2])


def test_position_stays_in_its_range():
    position = limiter(PositionLimiter, HARD)
    assert enforce(position, 9.0, position=0.95) == pytest.approx([1.0])
    position.reset()
    assert enforce(position, -9.0, position=-0.95) == pytest.approx([-1.0])


def test_position_without_limits_is_free():
    assert enforce(limiter(PositionLimiter, JointLimits()), 100.0) == pytest.approx([100.0])
    assert enforce(limiter(PositionLimiter, JointLimits(lower=-1, upper=1)), 100.0) == pytest.approx([1.0])
    assert enforce(limiter(PositionLimiter, JointLimits(velocity=2.0)), 100.0) == pytest.approx([0.2])


def test_soft_position_limits_slow_down_towards_their_ends():
    position = limiter(PositionLimiter, SOFT)
    # 0.6: k_position * 0.2 = 1 rad/s is less than the limit of 2 rad/s.
    assert enforce(position, 9.0, position=0.6) == pytest.approx([0.7])
    position.reset()
    assert enforce(position, 9.0, position=0.0) == pytest.approx([0.2])
    position.reset()
    # Beyond the soft end the joint is led back, for any command.
    assert enforce(position, 9.0, position=0.9) == pytest.approx([0.85])


def test_soft_limits_without_a_range_leave_the_velocity_limit():
    position = limiter(PositionLimiter, JointLimits(velocity=2.0, soft=SoftLimits(-0.8, 0.8, 5.0, 4.0)))
    assert enforce(position, 9.0, position=5.0) == pytest.approx([5.2])


def test_hard_and_soft_joints_share_a_limiter():
    assert enforce(limiter(PositionLimiter, HARD, SOFT), [9.0, 9.0], position=0.6) == pytest.approx([0.8, 0.7])


def test_soft_limits_without_a_velocity_limit_are_left_out():
    limits = JointLimits(-1, 1, soft=SOFT.soft)
    assert without_idle_soft_limits(limits) == JointLimits(-1, 1)
    assert without_idle_soft_limits(SOFT) is SOFT


# -- velocity -------------------------------------------------------------------------------------------------------


def test_velocity_is_clamped():
    assert enforce(limiter(VelocityLimiter, HARD, HARD), [9.0, -9.0]) == pytest.approx([2.0, -2.0])


def test_velocity_changes_by_no_more_than_the_acceleration_allows():
    velocity = limiter(VelocityLimiter, JointLimits(velocity=2.0, acceleration=5.0))
    assert [float(enforce(velocity, 9.0)[0]) for _ in range(5)] == pytest.approx([0.5, 1.0, 1.5, 2.0, 2.0])
    assert enforce(velocity, -9.0) == pytest.approx([1.5])


def test_soft_velocity_limits_depend_on_the_position():
    velocity = limiter(VelocityLimiter, SOFT)
    assert enforce(velocity, 9.0, position=0.6) == pytest.approx([1.0])
    assert enforce(velocity, -9.0, position=0.6) == pytest.approx([-2.0])
    assert enforce(velocity, 9.0, position=0.9) == pytest.approx([-0.5])


def test_soft_velocity_counts_acceleration_from_the_measured_velocity():
    soft = JointLimits(-1, 1, 2.0, 5.0, 10.0, SOFT.soft)
    assert enforce(limiter(VelocityLimiter, soft), 9.0, velocity=1.0) == pytest.approx([1.5])


def test_a_velocity_without_a_limit_is_passed_on():
    assert enforce(limiter(VelocityLimiter, JointLimits(), HARD), [900.0, 900.0]) == pytest.approx([900.0, 2.0])


# -- effort ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("position", "velocity", "low", "high"), [
    (0.0, 0.0, -10.0, 10.0),
    (-1.1, 0.0, 0.0, 10.0),
    (1.1, 0.0, -10.0, 0.0),
    (0.0, -2.1, 0.0, 10.0),
    (0.0, 2.1, -10.0, 0.0),
])
def test_effort_does_not_drive_beyond_other_limits(position, velocity, low, high):
    effort = limiter(EffortLimiter, HARD)
    assert enforce(effort, -99.0, position, velocity) == pytest.approx([low])
    assert enforce(effort, 99.0, position, velocity) == pytest.approx([high])


def test_soft_effort_limits():
    effort = limiter(EffortLimiter, SOFT)
    # At 0.6 rad at most 1 rad/s; at 0.5 rad/s the highest effort is k_velocity * 0.5, the lowest the limit.
    assert enforce(effort, 99.0, position=0.6, velocity=0.5) == pytest.approx([2.0])
    assert enforce(effort, -99.0, position=0.6, velocity=0.5) == pytest.approx([-10.0])
    assert enforce(effort, 99.0, position=0.9, velocity=0.0) == pytest.approx([-2.0])


@pytest.mark.parametrize(("limits", "velocity", "allowed"), [
    (JointLimits(), 5.0, 900.0), (JointLimits(velocity=1), 0.5, 900.0), (JointLimits(velocity=1), 1.5, 0.0),
    (JointLimits(effort=7), 5.0, 7.0),
])
def test_of_an_effort_only_the_limits_that_there_are_are_enforced(limits, velocity, allowed):
    assert enforce(limiter(EffortLimiter, limits), 900.0, velocity=velocity) == pytest.approx([allowed])


# -- sources of limits ---------------------------------------------------------------------------------------------

URDF = """<robot name="r"><link name="base"/>%s%s</robot>"""
JOINT = """<link name="l_%(name)s"/><joint name="%(name)s" type="%(kind)s"><parent link="base"/>
  <child link="l_%(name)s"/><axis xyz="0 0 1"/>%(limit)s</joint>"""
LIMIT = '<limit lower="-1" upper="2" velocity="3" effort="4"/>'
SAFETY = '<safety_controller soft_lower_limit="-0.5" soft_upper_limit="0.5" k_position="10" k_velocity="20"/>'
TRANSMISSION = """<transmission name="%(transmission)s"><type>transmission_interface/SimpleTransmission</type>
  <joint name="%(joint)s">%(interface)s</joint>
  <actuator name="m"><mechanicalReduction>%(reduction)s</mechanicalReduction></actuator></transmission>"""
INTERFACE = "<hardwareInterface>hardware_interface/%sJointInterface</hardwareInterface>"


def joint(kind="revolute", limit=LIMIT):
    return parse_urdf(URDF % (JOINT % {"name": "a", "kind": kind, "limit": limit}, "")).joints["a"]


def transmission(joint="a", transmission="tran1", interface=INTERFACE % "Position", reduction="1"):
    return TRANSMISSION % locals()


def read(*transmissions, known=("a", "b")):
    return read_transmissions(URDF % ("", "".join(transmissions)), known)


def test_urdf_limits():
    assert limits_from_urdf(joint()) == JointLimits(-1, 2, 3, math.inf, 4)
    assert limits_from_urdf(joint("continuous")) == JointLimits(-math.inf, math.inf, 3, math.inf, 4)


def test_soft_limits_come_from_the_safety_controller():
    xml = URDF % (JOINT % {"name": "a", "kind": "revolute", "limit": LIMIT + SAFETY}, "")
    assert read_soft_limits(xml) == {"a": SoftLimits(-0.5, 0.5, 10, 20)}
    with pytest.raises(HardwareError, match="joint 'a', line 2: <safety_controller> has k_velocity=None"):
        read_soft_limits(xml.replace('k_velocity="20"', ""))


def test_parameters_override_what_they_name():
    base = JointLimits(-1, 2, 3, math.inf, 4)
    assert with_parameters(base, {"has_velocity_limits": True, "max_velocity": 1}, "p").velocity == 1
    assert with_parameters(base, {"has_velocity_limits": False}, "p").velocity == math.inf
    assert with_parameters(base, {"max_velocity": 1}, "p") == base, "only has_...: true makes values count"
    changed = with_parameters(base, {
        "has_position_limits": True, "min_position": -0.1, "max_position": 0.2, "has_acceleration_limits": True,
        "max_acceleration": 5.0, "has_effort_limits": False}, "p")
    assert changed == JointLimits(-0.1, 0.2, 3, 5.0, math.inf)
    assert with_parameters(base, {"has_position_limits": False}, "p").lower == -math.inf


@pytest.mark.parametrize(("values", "text"), [
    ({"has_velocity_limits": True}, "/r/joint_limits/a/max_velocity is None, expected a number"),
    ({"has_velocity_limits": "on"}, "has_velocity_limits is 'on', expected true or false"),
    ({"has_velocity_limits": True, "max_velocity": -1.0}, "is -1, expected 0 or more"),
    ({"has_position_limits": True, "min_position": 1, "max_position": 0}, "min_position 1 is above max_position 0"),
    ([1], "expected a mapping"),
])
def test_wrong_limit_parameters_are_named(values, text):
    with pytest.raises(HardwareError, match=text):
        with_parameters(JointLimits(), values, "/r/joint_limits/a")


# -- transmissions --------------------------------------------------------------------------------------------------


def test_transmissions_may_share_a_name():
    joints, warnings = read(transmission("a"), transmission("b", interface=INTERFACE % "Effort"))
    assert [(j.name, j.interface) for j in joints] == [("a", POSITION), ("b", EFFORT)] and not warnings


def test_reduction_and_offset_are_read():
    interface = INTERFACE % "Position" + "<offset>0.25</offset>"
    joints, warnings = read(transmission(reduction="-100", interface=interface))
    assert (joints[0].reduction, joints[0].offset, warnings) == (-100.0, 0.25, [])


@pytest.mark.parametrize("reduction", ["0", "many", "inf"])
def test_a_wrong_reduction_is_a_warning(reduction):
    joints, warnings = read(transmission(reduction=reduction))
    assert len(joints) == 1 and "mechanicalReduction" in warnings[0] and "no effect" in warnings[0]


@pytest.mark.parametrize(("cut", "lacks"), [
    ('name="tran1"', "a name"), ("<type>transmission_interface/SimpleTransmission</type>", "<type>"),
    ('joint name="a"', "a <joint> with a name"), (INTERFACE % "Position", "<hardwareInterface>"),
    ('<actuator name="m"><mechanicalReduction>1</mechanicalReduction></actuator>', "an <actuator>")])
def test_an_incomplete_transmission_is_left_out(cut, lacks):
    text = transmission().replace(cut, "joint" if cut.startswith("joint") else "")
    joints, warnings = read(text, transmission("b"))
    assert [j.name for j in joints] == ["b"] and len(warnings) == 1 and lacks in warnings[0]


def test_old_forms_are_read_with_a_warning():
    bare = transmission(interface="<hardwareInterface>EffortJointInterface</hardwareInterface>")
    joints, warnings = read(bare)
    assert joints[0].interface == EFFORT and "old name; write 'hardware_interface/EffortJointInterface'" in warnings[0]
    inside = transmission(interface="").replace("<mechanicalReduction>", INTERFACE % "Effort" + "<mechanicalReduction>")
    joints, warnings = read(inside)
    assert joints[0].interface == EFFORT and "belongs into <joint>" in warnings[0]


def test_only_the_first_interface_and_transmission_of_a_joint_counts():
    joints, warnings = read(transmission(interface=INTERFACE % "Position" + INTERFACE % "Effort"), transmission("a"))
    assert [j.interface for j in joints] == [POSITION] and len(warnings) == 2


def test_an_unknown_interface_leaves_out_its_transmission_alone():
    """As Franka's description: two transmissions of a driver of its own beside those of the joints."""
    joints, warnings = read(transmission("a", "state", interface=INTERFACE % "Laser"), transmission("a", "t_a"),
                            transmission("b", "model", interface=INTERFACE % "Radar"), transmission("b", "t_b"))
    assert [(j.name, j.interface) for j in joints] == [("a", POSITION), ("b", POSITION)]
    assert len(warnings) == 1, "one for all of them"
    for part in ("'state' (line 1) with 'hardware_interface/LaserJointInterface'", "'model'", "known are"):
        assert part in warnings[0]


def test_an_unknown_joint_leaves_out_its_transmission_alone():
    joints, warnings = read(transmission("c"), transmission("a"))
    assert [j.name for j in joints] == ["a"] and len(warnings) == 1
    assert "joint 'c'" in warnings[0] and "its joints are a, b" in warnings[0]


def test_further_transmissions_of_all_joints_are_one_warning():
    further = [transmission(joint, interface=INTERFACE % "Effort") for joint in "ab"]
    joints, warnings = read(transmission("a"), transmission("b"), *further, *further)
    assert [j.interface for j in joints] == [POSITION] * 2
    assert len(warnings) == 1 and warnings[0].count("for joint") == 4


def test_old_names_of_all_joints_are_one_warning_of_each_kind():
    """As a hand's description with 20 transmissions."""
    old = "".join("<hardwareInterface>%sJointInterface</hardwareInterface>" % name for name in ("Effort", "Position"))
    joints, warnings = read(transmission("a", "t_a", interface=old), transmission("b", "t_b", interface=old))
    assert [j.interface for j in joints] == [EFFORT] * 2
    assert len(warnings) == 2 and all("'t_a' (line 1), transmission 't_b' (line 3)" in line for line in warnings)
