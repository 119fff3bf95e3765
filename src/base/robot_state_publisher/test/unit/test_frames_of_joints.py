# SPDX-License-Identifier: BSD-3-Clause
"""The frames of /tf from joint positions: against the product of the description's matrices."""
import numpy as np
import pytest
import rospkg
from tf2_msgs.msg import TFMessage

import xacro
from robot_state_publisher.frames import Due, JointFrames, tf_name
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


def test_every_link_of_baxter_has_one_frame():
    description = rospkg.RosPack().get_path("baxter_description") + "/urdf/baxter.urdf.xacro"
    baxter = parse_urdf(xacro.process_file(description).toxml())
    frames, names = JointFrames(baxter), [joint.name for joint in baxter.movable_joints()]
    found = [*read(frames.moving(names, np.zeros(len(names)), TIME_NS)), *read(frames.fixed(0), 0)]
    assert sorted(child for _, child in found) == sorted(set(baxter.links) - {baxter.root})


def test_the_order_is_that_of_names_and_a_repeated_name_counts_once(robot):
    message = TFMessage().deserialize(JointFrames(robot).moving(["turns", "slides", "turns"], [0.1, 0.2, 9.0], 0))
    assert [one.child_frame_id for one in message.transforms] == ["d", "c", "b"]
    assert message == TFMessage().deserialize(JointFrames(robot).moving(["slides", "turns"], [0.2, 0.1], 0))


def test_a_joint_that_mimics_one_that_mimics_another():
    """As in the original, which goes by the order of names: ``b`` follows ``a``, and ``c`` follows ``b``."""
    joint = ('<joint name="%s" type="continuous"><parent link="l%d"/><child link="l%d"/><axis xyz="0 0 1"/>%s</joint>')
    mimic = '<mimic joint="%s" multiplier="2" offset="0.1"/>'
    text = "".join('<link name="l%d"/>' % number for number in range(4)) + joint % ("a", 0, 1, "") + joint % (
        "b", 1, 2, mimic % "a") + joint % ("c", 2, 3, mimic % "b")
    found = read(JointFrames(parse_urdf("<robot name='r'>%s</robot>" % text)).moving(["a"], [0.3], TIME_NS))
    for frames, angle in ((("l0", "l1"), 0.3), (("l1", "l2"), 0.7), (("l2", "l3"), 1.5)):
        turned = rigid(axis_rotation([0, 0, 1], angle)[:3, :3], np.zeros(3))
        np.testing.assert_allclose(found[frames], turned, atol=1e-12)


@pytest.mark.parametrize("prefix, frame, name", [
    ("", "base", "base"), ("left", "base", "left/base"), ("/left", "base", "left/base"), ("left", "/base", "base")])
def test_a_prefix(prefix, frame, name):
    assert tf_name(prefix, frame) == name


MS = 1_000_000


def test_states_are_sent_on_at_the_rate_and_again_when_time_goes_back():
    due = Due(20 * MS)
    times = [time for time in (5, 20, 24, 39, 40, 39, 60, 300, 30, 49, 50, 90) if due(["a"], time * MS)]
    assert times == [20, 40, 60, 300, 30, 50, 90]


def test_a_state_is_due_where_one_of_its_joints_is():
    due = Due(20 * MS)
    sent = [(names, time) for time in (20, 30, 40, 50) for names in ("ab", "bc", "x") if due(names, time * MS)]
    assert sent == [(names, time) for time in (20, 40) for names in ("ab", "bc", "x")]
    assert due("bd", 51 * MS)


def test_a_publisher_of_other_names_in_each_message_does_not_fill_the_memory(robot):
    frames = JointFrames(robot)
    for number in range(1000):
        names = ["slides", "stays", "x%d" % number]
        assert frames.known(names) == ["slides"] and frames.unknown(names) == names[2:]
        assert read(frames.moving(names, [0.2, 0.0, 0.0], TIME_NS)).keys() == {("b", "c")}
    assert len(frames._groups) < 10
