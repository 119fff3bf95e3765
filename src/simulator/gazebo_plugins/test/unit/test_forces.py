# SPDX-License-Identifier: BSD-3-Clause
"""Plugins of forces in small worlds with analytically known forces."""
import math

import numpy as np
import pytest
from geometry_msgs.msg import Vector3, Wrench

from bullet_sim import Pose
from gazebo_plugins.forces import Force, ForceTorqueSensor, LinkForce
from gazebo_ros.model_plugin import PluginError
from urdf_model import parse_urdf

G = 9.81
LINK = """<link name="%s"><inertial><origin xyz="%s 0 0"/><mass value="%s"/><inertia ixx="0.01" iyy="0.01" izz="0.01"
ixy="0" ixz="0" iyz="0"/></inertial>%s</link>"""
BALL = '<collision><origin xyz="%s 0 0"/><geometry><sphere radius="0.05"/></geometry></collision>'
JOINT = """<joint name="%s" type="%s"><parent link="%s"/><child link="%s"/><origin xyz="%s 0 0" rpy="%s 0 0"/>
<axis xyz="0 0 1"/></joint>"""
# A boom that turns about z, a flange that is fixed to it and rolled by a right angle, a tool that turns on that.
ARM = '<robot name="arm"><link name="world"/>%s%s%s%s%s%s%%s</robot>' % (
    LINK % ("boom", 0.25, 2, BALL % 0.1), LINK % ("flange", 0.1, 1, BALL % 0.2), LINK % ("tool", 0.2, 0.5, ""),
    JOINT % ("turn", "continuous", "world", "boom", 0, 0),
    JOINT % ("mount", "fixed", "boom", "flange", 0.5, math.pi / 2),
    JOINT % ("twist", "continuous", "flange", "tool", 0.3, -math.pi / 2))
CUBE = '<collision><geometry><box size="0.2 0.2 0.2"/></geometry></collision>'
BOX = '<robot name="box">' + LINK % ("link", 0, 2, CUBE) + "%s</robot>"


def said(lab):
    """Force and torque of the last message."""
    wrench = lab.sent("wrench")[-1].wrench
    return [np.array([part.x, part.y, part.z]) for part in (wrench.force, wrench.torque)]


def sensor(make, joint, **elements):
    return make(ARM, ForceTorqueSensor, {"jointName": joint, "topicName": "wrench", **elements}, Pose((0, 0, 1)))


@pytest.mark.parametrize(("joint", "mass", "lever"), [
    ("turn", 3.5, 2 * 0.25 + 1 * 0.6 + 0.5 * 1.0), ("mount", 1.5, 1 * 0.1 + 0.5 * 0.5), ("twist", 0.5, 0.5 * 0.2)])
def test_weight_hangs_on_every_joint_fixed_ones_too(make, joint, mass, lever):
    lab = sensor(make, joint).run(0.02)
    force, torque = said(lab)
    # Down, and about y; the flange is rolled, so that down is along its -y, and what was about y is about -z.
    axes = lab.model.link_pose({"turn": "boom", "mount": "flange", "twist": "tool"}[joint]).matrix()[:3, :3]
    np.testing.assert_allclose(axes @ force, (0, 0, -mass * G), atol=1e-6)
    np.testing.assert_allclose(axes @ torque, (0, lever * G, 0), atol=1e-6)
    if joint == "mount":
        np.testing.assert_allclose(force, (0, -mass * G, 0), atol=1e-6)
    assert lab.sent("wrench")[-1].header.frame_id in ("boom", "flange", "tool")


def test_a_sensor_may_be_in_the_sensor_of_its_joint(make):
    around = '<gazebo reference="mount"><sensor type="force_torque" name="ft">%s</sensor></gazebo>'
    lab = make(ARM, ForceTorqueSensor, {"topicName": "wrench"}, Pose((0, 0, 1)), sensor=around,
               filename="libgazebo_ros_ft_sensor.so").run(0.02)
    np.testing.assert_allclose(said(lab)[0], (0, -1.5 * G, 0), atol=1e-6)


def test_a_turning_arm_pulls_outwards(make):
    lab = sensor(make, "mount")
    index = lab.model.index(["turn", "twist"])
    lab.run(0.5, lambda: lab.model.drive_velocity(index, np.array([3.0, 0.0]), np.full(2, 1e3)))
    # m r w^2: 1 kg at 0.6 m and 0.5 kg at 1 m.
    assert said(lab)[0][0] == pytest.approx((1 * 0.6 + 0.5 * 1.0) * 9.0, rel=0.02)


def test_what_turns_the_arm_is_the_torque_about_its_joint(make):
    lab = make(ARM, ForceTorqueSensor, {"jointName": "turn", "topicName": "wrench"}, Pose((2, 3, 1)))
    index = lab.model.index(["turn"])
    lab.run(0.2, lambda: lab.model.drive_effort(index, np.array([5.0])))
    assert said(lab)[1][2] == pytest.approx(-5.0, abs=0.02)


def test_a_push_on_the_tool_goes_through_the_mount_and_one_before_it_does_not(make):
    lab = sensor(make, "mount")
    index = lab.model.index(["turn", "twist"])

    def hold():
        lab.model.drive_position(index, np.zeros(2), np.full(2, 1e4))

    resting = [part.copy() for part in said(lab.run(0.1, hold))]
    lab.run(0.2, lambda: (hold(), lab.model.apply_wrench("boom", (100.0, 0.0, 0.0), position=(0.1, 0.0, 1.0))))
    np.testing.assert_allclose(said(lab)[0], resting[0], atol=0.5)
    lab.run(0.2, lambda: (hold(), lab.model.apply_wrench("tool", (100.0, 0.0, 0.0))))
    np.testing.assert_allclose(said(lab)[0] - resting[0], (100.0, 0.0, 0.0), atol=0.5)


def test_what_touches_the_fixed_flange_is_felt_behind_its_mount_only(make):
    held = {}
    for joint in ("mount", "turn"):
        lab = sensor(make, joint)
        lab.world.spawn(parse_urdf(BOX % ""), "box", Pose((0.7, 0.0, 1.151)))
        index = lab.model.index(["turn", "twist"])
        lab.run(0.3, lambda lab=lab, index=index: lab.model.drive_position(index, np.zeros(2), np.full(2, 1e4)))
        axes = lab.model.link_pose("flange" if joint == "mount" else "boom").matrix()[:3, :3]
        held[joint] = (axes @ said(lab)[0])[2]
    # The box of 2 kg lies on the flange's ball, which both carry.
    assert held["mount"] == pytest.approx(-(1.5 + 2) * G, rel=0.05)
    assert held["turn"] == pytest.approx(-(3.5 + 2) * G, rel=0.05)


def test_what_touches_the_boom_is_not_felt_at_the_flange(make):
    lab = sensor(make, "mount")
    lab.world.spawn(parse_urdf(BOX % ""), "box", Pose((0.1, 0.0, 1.151)))
    index = lab.model.index(["turn", "twist"])
    lab.run(0.1, lambda: lab.model.drive_position(index, np.zeros(2), np.full(2, 1e4)))
    assert lab.world.contacts(lab.model)
    assert said(lab)[0][1] == pytest.approx(-1.5 * G, rel=0.05)


def test_the_rate_and_the_noise(make):
    lab = sensor(make, "twist", updateRate=50, gaussianNoise=0.1).run(1.0)
    messages = lab.sent("wrench")
    assert len(messages) == pytest.approx(50, abs=1)
    assert 0.02 < np.std([message.wrench.force.x for message in messages]) < 0.3


def test_nobody_listens_nothing_is_computed(make):
    lab = sensor(make, "twist")
    lab.ros.publishers["/ns/wrench"].has_listeners = False
    lab.plugin._joint = None
    lab.run(0.01)


def test_an_unknown_joint_is_refused_and_the_known_ones_named(make):
    with pytest.raises(PluginError, match="no joint 'nose'; its joints are turn, mount, twist"):
        make(ARM, ForceTorqueSensor, {"jointName": "nose", "topicName": "wrench"})


def test_a_box_on_the_floor_feels_the_floor(make):
    lab = make(BOX, LinkForce, {"bodyName": "link", "topicName": "wrench"}, Pose((0, 0, 0.1)))
    lab.run(0.5)
    force, torque = said(lab)
    np.testing.assert_allclose(force, (0, 0, 2 * G), atol=0.4)
    np.testing.assert_allclose(torque, 0.0, atol=0.1)
    # A push below the friction limit is balanced by the floor: the sensor measures the weight again.
    lab.run(0.5, lambda: lab.model.apply_wrench("link", (3.0, 0.0, 0.0)))
    np.testing.assert_allclose(said(lab)[0], (0, 0, 2 * G), atol=0.4)


def test_a_force_acts_until_the_next_one(make):
    lab = make(BOX, Force, {"bodyName": "link", "topicName": "push"}, Pose((0, 0, 1.0)))
    lab.world.set_gravity((0, 0, 0))
    lab.ros.subscriptions["/ns/push"].put(Wrench(Vector3(4.0, 0, 0), Vector3()))
    lab.run(1.0)
    assert lab.model.base_twist()[0][0] == pytest.approx(2.0, rel=0.01)
    lab.ros.subscriptions["/ns/push"].put(Wrench(Vector3(math.nan, 0, 0), Vector3()))
    lab.run(0.1)
    assert "ignored" in lab.log.of("warn")[0]
    lab.ros.subscriptions["/ns/push"].put(Wrench())
    speed = lab.run(0.1).model.base_twist()[0][0]
    assert speed == pytest.approx(2.2, rel=0.01)
    assert lab.run(0.2).model.base_twist()[0][0] == speed


@pytest.mark.parametrize(("elements", "text"), [({"bodyName": "nose", "topicName": "push"}, "<bodyName> is 'nose'"),
                                                ({"bodyName": "link"}, "names no topic")])
def test_wrong_elements_of_a_force_are_named(make, elements, text):
    with pytest.raises(PluginError, match=text):
        make(BOX, Force, elements)
