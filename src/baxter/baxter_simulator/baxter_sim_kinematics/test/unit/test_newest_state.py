# SPDX-License-Identifier: BSD-3-Clause
"""Joint states are kept as bytes until they are read."""
from io import BytesIO

import genpy
import pytest
from sensor_msgs.msg import JointState

from baxter_sim_kinematics.newest_state import NewestState, UnreadJointState

ARM = ["left_s0", "left_s1"]


def arrived(names, stamp, positions=None):
    message = JointState(name=names, position=positions or [0.5] * len(names))
    message.header.stamp = genpy.Time(*stamp)
    buffer = BytesIO()
    message.serialize(buffer)
    return UnreadJointState().deserialize(buffer.getvalue())


def test_the_header_can_be_read_by_itself():
    assert arrived(ARM, (7, 8)).header.stamp == genpy.Time(7, 8)


@pytest.fixture
def jumps():
    return []


@pytest.fixture
def newest(jumps):
    return NewestState(ARM, lambda: jumps.append(True))


def test_nothing_is_known_before_the_first(newest):
    assert newest.read() is None


def test_newest_is_read_as_it_was_sent_and_decoded_once(newest):
    newest.take(arrived(ARM, (1, 0)))
    newest.take(arrived(["head_pan", *ARM], (2, 7), [0.1, 0.2, 0.3]))
    state = newest.read()
    assert (state.name, list(state.position), state.header.stamp) == (
        ["head_pan", *ARM], [0.1, 0.2, 0.3], genpy.Time(2, 7))
    assert newest.read() is state


@pytest.mark.parametrize("names", [["left_s0"], ["gripper"], [], ["left_s0", "left_s10"], ["left_s0", "an_left_s1"]])
def test_message_without_all_of_the_arm_does_not_count(newest, names):
    assert newest.take(arrived(ARM, (1, 0)))
    assert not newest.take(arrived(names, (2, 0)))
    assert newest.read().name == ARM


def test_time_that_goes_back_is_told(newest, jumps):
    for stamp in ((5, 0), (5, 1), (5, 1), (6, 0)):
        newest.take(arrived(ARM, stamp))
    assert jumps == []
    newest.take(arrived(ARM, (5, 9)))
    assert jumps == [True]
    assert newest.read().header.stamp == genpy.Time(5, 9)


def test_message_that_ends_in_its_header_is_refused():
    with pytest.raises(genpy.DeserializationError, match="7 bytes"):
        UnreadJointState().deserialize(b"1234567")


def test_it_is_a_joint_state_on_the_wire():
    assert (UnreadJointState._type, UnreadJointState._md5sum) == (JointState._type, JointState._md5sum)
