# SPDX-License-Identifier: BSD-3-Clause
"""A lift goes to floors with its door closed; a model starts with its velocity."""
import pytest
from std_msgs.msg import String

from bullet_sim import World
from gazebo_plugins.elevator import Elevator, InitialVelocity
from gazebo_ros.model_plugin import PluginContext, PluginError, PluginSource
from gazebo_ros.urdf_extras import plugins
from loop_ros.testing import FakeLog, FakeRos
from sdf_model import parse_sdf_model

INERTIA = '<inertial><mass value="%g"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
LIFT = """<robot name="lift"><link name="world"/><link name="cabin">%s</link><link name="leaf">%s</link>
<joint name="shaft" type="prismatic"><parent link="world"/><child link="cabin"/><axis xyz="0 0 1"/>
<limit lower="-10" upper="40" effort="1e5" velocity="10"/></joint><joint name="door" type="prismatic">
<parent link="cabin"/><child link="leaf"/><axis xyz="0 1 0"/><limit lower="0" upper="1" effort="10" velocity="10"/>
</joint>%%s</robot>""" % (INERTIA % 800, INERTIA % 2)
BALL = """<robot name="ball"><link name="it">%s</link>%%s</robot>""" % (INERTIA % 1)
JOINTS = {"lift_joint": "lift::shaft", "door_joint": "door", "floor_height": 3.0, "door_wait_time": 2.0}


def at(lab):
    return dict(zip(lab.model.joint_names, lab.model.read_joints()[0], strict=True))


def test_it_goes_to_a_floor_and_opens_its_door_there_for_the_waiting_time(make):
    lab = make(LIFT, Elevator, JOINTS)
    lab.run(0.5)
    assert at(lab)["shaft"] == pytest.approx(0.0, abs=1e-3)
    commands = lab.ros.subscriptions["/ns/elevator"]
    commands.put(String("2"))
    lab.run(1.0)
    assert at(lab)["shaft"] > 1.0 and at(lab)["door"] < 0.01
    commands.put(String("5"))  # it is under way
    lab.run(5.0)
    assert at(lab)["shaft"] == pytest.approx(6.0, abs=0.05) and at(lab)["door"] > 0.9
    lab.run(6.0)
    assert at(lab)["door"] < 0.06 and at(lab)["shaft"] == pytest.approx(6.0, abs=0.01)
    commands.put(String("-1"))
    lab.run(12.0)
    assert at(lab)["shaft"] == pytest.approx(-3.0, abs=0.01)


def test_what_is_no_floor_and_no_joint_is_named(make):
    lab = make(LIFT, Elevator, JOINTS)
    lab.ros.subscriptions["/ns/elevator"].put(String("roof"))
    lab.run(0.1)
    assert "'roof' was commanded, expected the number of a floor" in lab.log.of("warn")[0]
    with pytest.raises(PluginError, match="<door_joint> is 'gate', expected one of the prismatic joints shaft, door"):
        make(LIFT, Elevator, {**JOINTS, "door_joint": "gate"})


def test_a_model_starts_with_its_velocity_and_so_again_after_a_reset(make):
    lab = make(BALL, InitialVelocity, {"linear": "1 2 3", "angular": "0 0 0.5"})
    lab.world.set_gravity((0, 0, 0))
    for _ in range(2):
        lab.run(0.5)
        assert lab.model.base_pose().position == pytest.approx((0.5, 1.0, 1.5), abs=1e-6)
        assert lab.model.base_twist()[1] == pytest.approx((0, 0, 0.5))
        lab.world.reset_models()
        lab.plugin.reset()
    with pytest.raises(PluginError, match="expected three numbers"):
        make(BALL, InitialVelocity, {"linear": "1 2"})


def test_in_a_model_of_models_each_has_its_own_velocity():
    world = World(time_step_s=0.001, gravity=(0, 0, 0))
    ball = """<model name="%s"><pose>%g 0 0 0 0 0</pose><link name="it"/><plugin name="p"
        filename="libInitialVelocityPlugin.so"><linear>0 %g 0</linear></plugin></model>"""
    robot = parse_sdf_model('<sdf version="1.6"><model name="m">%s%s</model></sdf>' % (
        ball % ("one", 0, 1), ball % ("two", 3, 2)), "m.sdf").robot
    model = world.spawn(robot, "m")
    for element in plugins(robot):
        InitialVelocity(PluginContext(world, model, PluginSource(robot, element, "", ""), FakeLog(), FakeRos(), {}))
    assert [model.link_twist(link)[0][1] for link in ("one::it", "two::it")] == pytest.approx([1.0, 2.0])
    world.close()
