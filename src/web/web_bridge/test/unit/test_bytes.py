# SPDX-License-Identifier: BSD-3-Clause
"""A message that came as bytes reads itself for a callback that asks for its fields."""
import copy
import pickle
from io import BytesIO

import pytest
import rospy
from geometry_msgs.msg import TransformStamped
from tf2_msgs.msg import TFMessage

from web_bridge.errors import UnknownType
from web_bridge.ros_graph import Bytes

STAMPED = TransformStamped()
STAMPED.child_frame_id = "left_gripper"
SENT = TFMessage([STAMPED])


def arrived(type_name="tf2_msgs/TFMessage"):
    """The message as rospy delivers it."""
    buffer = BytesIO()
    SENT.serialize(buffer)
    message = Bytes().deserialize(buffer.getvalue())
    message._connection_header = {"type": type_name, "callerid": "/talker"}
    return message


def test_fields_are_those_of_the_type_that_the_publisher_names():
    message = arrived()
    assert isinstance(message, rospy.AnyMsg)
    assert message.transforms == SENT.transforms
    assert message.transforms is message.transforms
    assert message._connection_header["callerid"] == "/talker"


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, lambda message: pickle.loads(pickle.dumps(message))])
def test_a_copy_reads_itself_too(copied):
    message = copied(arrived())
    assert message.transforms == SENT.transforms and message._connection_header["callerid"] == "/talker"


def test_what_is_no_field_is_an_error():
    with pytest.raises(AttributeError, match="positions"):
        arrived().positions  # noqa: B018
    with pytest.raises(AttributeError, match="_of_nobody"):
        arrived()._of_nobody  # noqa: B018
    with pytest.raises(UnknownType, match="nowhere/Nothing' is not on this machine"):
        arrived("nowhere/Nothing").transforms  # noqa: B018
