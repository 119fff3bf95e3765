# SPDX-License-Identifier: BSD-3-Clause
"""The JSON in a gripper's state, without ROS connections."""
import pytest
from baxter_core_msgs.msg import EndEffectorState

from baxter_interface.gripper_link import GripperLink


@pytest.mark.parametrize("text, details", [
    ('{"vacuum sensor": 12, "sucking": true}', {"vacuum sensor": 12, "sucking": True}), ("", {}),
    ("[1]", {}), ("{", {}), ('{"vacuum sensor": %s}' % ("9" * 400), {}),
    ('{"a":' * 5000, {}), ('{"a":' * 1900 + "1" + "}" * 1900, {}), ('{"a":' * 100000 + "1" + "}" * 100000, {})])
def test_details_are_what_can_be_read_of_the_state_and_never_an_error(text, details):
    link = GripperLink.__new__(GripperLink)  # its constructor waits for a robot
    link.state = EndEffectorState(state=text)
    assert link.details == details
