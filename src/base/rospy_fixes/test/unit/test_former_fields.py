# SPDX-License-Identifier: BSD-3-Clause
"""Programs written for ROS Kinetic set fields that Noetic's messages lack."""
import copy
import io

import genpy
import pytest

from rospy_fixes import former_fields


@pytest.fixture
def request_type():
    class PositionIKRequest(genpy.Message):
        _md5sum, _type, __slots__, _slot_types = "0" * 32, "moveit_msgs/PositionIKRequest", ["group_name"], ["string"]

        def __init__(self, *arguments, **values):
            super().__init__(*arguments, **values)
            self.group_name = getattr(self, "group_name", None) or ""

    former_fields.amend(type("messages", (), {"PositionIKRequest": PositionIKRequest}))
    return PositionIKRequest


def test_a_former_field_is_accepted_and_told_once(request_type, capsys):
    first, second = request_type(group_name="left_arm", attempts=5), request_type()
    second.attempts = 7
    assert first.group_name == "left_arm" and second.attempts == 0 and copy.deepcopy(first) == first
    told = capsys.readouterr().err
    assert told.count("\n") == 1 and "PositionIKRequest.attempts" in told
    assert "attempts" not in str(first) and request_type.__slots__ == ["group_name"]


def test_other_unknown_fields_are_errors_as_before(request_type):
    with pytest.raises(AttributeError):
        request_type(tries=5)
    with pytest.raises(AttributeError):
        request_type().tries = 5


def test_moveits_request_is_amended_where_it_is_imported():
    from moveit_msgs.msg import PositionIKRequest

    request, plain = PositionIKRequest(), PositionIKRequest()
    request.attempts = 3
    written, expected = io.BytesIO(), io.BytesIO()
    request.serialize(written)
    plain.serialize(expected)
    assert written.getvalue() == expected.getvalue() and PositionIKRequest._md5sum
