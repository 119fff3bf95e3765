# SPDX-License-Identifier: BSD-3-Clause
"""Which of a transmission's hardware interfaces its joint gets."""
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
