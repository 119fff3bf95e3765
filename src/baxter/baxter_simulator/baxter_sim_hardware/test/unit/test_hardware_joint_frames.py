# SPDX-License-Identifier: BSD-3-Clause
"""The frames of /tf from joint positions: against the product of the description's matrices."""
import numpy as np
import pytest
from tf2_msgs.msg import TFMessage

import xacro
from baxter_sim_hardware.joint_frames import Due, JointFrames
from urdf_model import parse_urdf
from urdf_model.transforms import axis_rotation, matrix_from_quaternion, rigid

TIME_NS = 12_345_678_901
ARM = """<robot name="arm"><link name="a"/><link name="b"/><link name="c"/><link name="d"/><link name="e"/>
<joint name="turns" type="revolute"><parent link="a"/><child link="b"/><origin xyz="1 2 3" rpy="0.3 -1.2 3.1"/>
<axis xyz="0.6 0 -0.8"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
<joint name="slides" type="prismatic"><parent link="b"/><child link="c"/><origin xyz="0 -1 0" rpy="1 2 3"/>
<axis xyz="0 0.6 0.8"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
<joint name="follows" type="continuous"><parent link="c"/><child link="d"/><origin rpy="0 0 -3"/><axis xyz="0 0 1"/>
<mimic joint="turns" multiplier="-2" offset="0.5"/></joint>
<joint name="stays" type="fixed"><parent link="d"/><child link="é"/><origin xyz="4 5 6" rpy="0.1 0.2 0.3"/></joint>
</robot>""".replace('name="e"', 'name="é"')


@pytest.fixture(scope="module")
def robot():
    return parse_urdf(ARM)


def read(data, time_ns=TIME_NS):
    """{(parent, child): (4, 4)} of a message's bytes."""
    message = TFMessage().deserialize(data)
    found = {}
    for one in message.transforms:
        assert one.header.stamp.to_nsec() == time_ns
        t, q = one.transform.translation, one.transform.rotation
        assert q.x**2 + q.y**2 + q.z**2 + q.w**2 == pytest.approx(1.0, abs=1e-12)
        found[one.header.frame_id, one.child_frame_id] = rigid(
            matrix_from_quaternion([q.x, q.y, q.z, q.w]), [t.x, t.y, t.z])
    assert len(found) == len(message.transforms)
    return found


def motion(joint, value):
    """(4, 4) of a joint at ``value``."""
    if joint.type == "prismatic":
        return joint.origin @ rigid(np.eye(3), joint.axis * value)
    return joint.origin @ rigid(axis_rotation(joint.axis, value)[:3, :3], np.zeros(3))


@pytest.mark.parametrize("turn, slide", [(0.0, 0.0), (1.1, 0.4), (-2.9, -0.7), (3.0, 0.1)])
def test_joints_of_each_type_and_those_that_mimic_are_where_the_description_puts_them(robot, turn, slide):
    found = read(JointFrames(robot).moving(["slides", "nobody", "turns"], (slide, 9.0, turn), TIME_NS))
    values = {"turns": turn, "slides": slide, "follows": 0.5 - 2.0 * turn}
    assert found.keys() == {(robot.joints[name].parent, robot.joints[name].child) for name in values}
    for name, value in values.items():
        joint = robot.joints[name]
        np.testing.assert_allclose(found[joint.parent, joint.child], motion(joint, value), atol=1e-12)


def test_a_message_with_other_joints_and_one_that_says_where_a_follower_is(robot):
    frames = JointFrames(robot)
    assert read(frames.moving(["slides"], [0.2], TIME_NS)).keys() == {("b", "c")}
    found = read(frames.moving(["follows", "turns"], [0.7, 0.0], TIME_NS))
    np.testing.assert_allclose(found["c", "d"], motion(robot.joints["follows"], 0.7), atol=1e-12)
    assert read(frames.moving(["nobody"], [0.2], TIME_NS)) == read(frames.moving([], [], TIME_NS)) == {}


def test_fixed_joints(robot):
    found = read(JointFrames(robot).fixed(0), 0)
    assert found.keys() == {("d", "é")}
    np.testing.assert_allclose(found["d", "é"], robot.joints["stays"].origin, atol=1e-12)


def test_every_link_of_baxter_has_one_frame(robot_file):
    baxter = parse_urdf(xacro.process_file(robot_file).toxml())
    frames, names = JointFrames(baxter), [joint.name for joint in baxter.movable_joints()]
    found = [*read(frames.moving(names, np.zeros(len(names)), TIME_NS)), *read(frames.fixed(0), 0)]
    assert sorted(child for _, child in found) == sorted(set(baxter.links) - {baxter.root})


def test_states_are_sent_on_at_the_rate_and_again_when_time_goes_back():
    due = Due(20)
    assert [time for time in (5, 6, 24, 25, 40, 45, 90, 3, 4, 23) if due(["a"], time)] == [5, 25, 45, 90, 3, 23]


def test_fingers_in_a_message_of_their_own_are_sent_on_as_often_as_the_arms():
    due = Due(20)
    sent = [(names, time) for time in (0, 10, 20, 30, 40) for names in ("arms", "fingers") if due([names], time)]
    assert sent == [(names, time) for time in (0, 20, 40) for names in ("arms", "fingers")]


def test_who_sends_other_names_in_each_message_does_not_fill_the_memory(robot):
    frames, due = JointFrames(robot), Due(20)
    for number in range(1000):
        names = ["slides", "x%d" % number]
        assert due(names, 0)
        assert read(frames.moving(names, [0.2, 0.0], TIME_NS)).keys() == {("b", "c")}
    assert len(due._last_ns) < 10 and len(frames._groups) < 10
