# SPDX-License-Identifier: BSD-3-Clause
"""Which hardware interfaces and which joints of a transmission count."""
import pytest

from controller_manager.transmissions import read_transmissions

ROBOT = """<robot name="r"><transmission name="t"><type>transmission_interface/SimpleTransmission</type>
<joint name="j">%s</joint><actuator name="a"/></transmission></robot>"""
STATE, POSITION, VELOCITY = ("hardware_interface/%sInterface" % kind for kind in (
    "JointState", "PositionJoint", "VelocityJoint"))


@pytest.mark.parametrize("names, expected", [
    ((POSITION, STATE), "Position"), ((STATE, POSITION), "Position"), ((STATE, VELOCITY, POSITION), "Velocity")])
def test_the_first_interface_that_takes_commands_counts(names, expected):
    text = "".join("<hardwareInterface>%s</hardwareInterface>" % name for name in names)
    joints, warnings = read_transmissions(ROBOT % text, ["j"])
    assert len(joints) == len(warnings) == 1
    assert expected + "Joint" in warnings[0].rpartition(" only ")[2]


TWO = """<robot name="r"><transmission name="wrist"><type>transmission_interface/%s</type>
<joint name="pitch"><hardwareInterface>hardware_interface/PositionJointInterface</hardwareInterface></joint>
<joint name="roll"><hardwareInterface>hardware_interface/PositionJointInterface</hardwareInterface></joint>
<actuator name="a"><mechanicalReduction>-1.0</mechanicalReduction></actuator>
<actuator name="b"><mechanicalReduction>2.0</mechanicalReduction></actuator></transmission></robot>"""


@pytest.mark.parametrize("kind", ["DifferentialTransmission", "FourBarLinkageTransmission"])
def test_both_joints_of_a_transmission_for_two_take_commands(kind):
    joints, warnings = read_transmissions(TWO % kind, ["pitch", "roll"])
    assert [(joint.name, joint.reduction) for joint in joints] == [("pitch", -1.0), ("roll", 2.0)]
    assert not warnings


def test_of_a_simple_transmission_only_the_first_joint_counts():
    joints, warnings = read_transmissions(TWO % "SimpleTransmission", ["pitch", "roll"])
    assert [joint.name for joint in joints] == ["pitch"]
    assert "only the first one, 'pitch'" in warnings[0]
