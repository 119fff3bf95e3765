# SPDX-License-Identifier: BSD-3-Clause
"""What the page's server hears of the robot's grippers."""
from io import BytesIO

import rospy
from baxter_core_msgs.msg import EndEffectorState

from lab_web.robot import _of_kind


def test_a_message_that_comes_as_bytes_since_another_client_was_first_is_read():
    heard, buffer = [], BytesIO()
    take = _of_kind(EndEffectorState, lambda *what: heard.append(what))
    state = EndEffectorState(position=12.0, command="go")
    state.serialize(buffer)
    take(rospy.AnyMsg().deserialize(buffer.getvalue()), "left")
    take(state, "right")
    assert heard == [(state, "left"), (state, "right")]
