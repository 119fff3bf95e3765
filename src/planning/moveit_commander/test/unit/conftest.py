# SPDX-License-Identifier: BSD-3-Clause
"""Commanders of a small arm with a stand-in for the way to move_group."""
from types import SimpleNamespace

import pytest
import rospy
from moveit_msgs.msg import MoveItErrorCodes, PlanningScene

from motion_planning.model import PlanningModel
from moveit_commander import move_group, planning_scene_interface, robot
from moveit_commander.description import Description
from moveit_commander.states import message_of

URDF = """<robot name="arm"><link name="base"/><link name="upper"/><link name="lower"/><link name="tool"/>
  <link name="finger"/><link name="thumb"/>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 0 1"/>
    <origin xyz="0 0 0.5"/><limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/><axis xyz="0 1 0"/>
    <origin xyz="0.4 0 0"/><limit lower="0.2" upper="2.6" effort="1" velocity="1"/></joint>
  <joint name="flange" type="fixed"><parent link="lower"/><child link="tool"/><origin xyz="0.3 0 0"/></joint>
  <joint name="grip" type="prismatic"><parent link="tool"/><child link="finger"/><axis xyz="0 1 0"/>
    <limit lower="0" upper="0.04" effort="1" velocity="1"/></joint>
  <joint name="oppose" type="prismatic"><parent link="tool"/><child link="thumb"/><axis xyz="0 -1 0"/>
    <limit lower="0" upper="0.08" effort="1" velocity="1"/><mimic joint="grip" multiplier="2" offset="0.01"/></joint>
</robot>"""
SRDF = """<robot name="arm">
  <virtual_joint name="stand" type="floating" parent_frame="world" child_link="base"/>
  <group name="arm"><chain base_link="base" tip_link="tool"/></group>
  <group name="hand"><joint name="grip"/><joint name="oppose"/></group>
  <group name="all"><group name="arm"/><group name="hand"/></group>
  <group_state name="ready" group="arm">
    <joint name="shoulder" value="0.5"/><joint name="elbow" value="1"/>
  </group_state>
  <group_state name="open" group="hand">
    <joint name="grip" value="0.03"/><joint name="oppose" value="0.07"/>
  </group_state>
  <end_effector name="gripper" group="hand" parent_link="tool" parent_group="arm"/>
</robot>"""


class FakeConnection:
    """Answers as a move_group would, and remembers what it was asked.

    joints: {joint: value} of the robot now. results: action to its result and text; answers: service to its answer.
    """

    def __init__(self, model):
        self._model = model
        self.joints = {"shoulder": 0.0, "elbow": 1.0, "grip": 0.02}
        self.base = None
        self.objects, self.held = [], []
        self.results, self.answers = {}, {}
        self.sent, self.started, self.called, self.published = [], [], [], []
        self.waited_for, self.cancelled = [], 0

    def advertise(self, name):
        return SimpleNamespace(publish=lambda message: self.publish(name, message))

    def service(self, name):
        return lambda request: self.call(name, scene=request.scene)

    def wait_for_actions(self, names, seconds):
        self.waited_for += names

    def start(self, name, goal):
        self.started.append((name, goal))

    def run(self, name, goal):
        self.sent.append((name, goal))
        return self.results[name]

    def cancel(self):
        self.cancelled += 1

    def publish(self, name, message):
        self.published.append((name, message))

    def call(self, name, **fields):
        self.called.append((name, fields))
        if name == "get_planning_scene":
            return SimpleNamespace(scene=self.scene())
        return self.answers[name]

    def scene(self):
        scene = PlanningScene()
        scene.robot_state = message_of(self._model, self._model.state(self.joints, self.base))
        for part in (scene.robot_state.joint_state, scene.robot_state.multi_dof_joint_state):
            part.header.stamp = rospy.Time(6)
        scene.robot_state.attached_collision_objects = self.held
        scene.world.collision_objects = self.objects
        return scene


@pytest.fixture(scope="session")
def model():
    return PlanningModel.from_xml(URDF, SRDF, {"shoulder": {"max_acceleration": 2.0}})


@pytest.fixture
def connection(model, monkeypatch):
    connection = FakeConnection(model)
    description = Description(model, {"hand": {"goal_joint_tolerance": 0.01}}, 0.1, 0.2)
    for module in (move_group, robot):
        monkeypatch.setattr(module, "connect", lambda namespace: connection)
        monkeypatch.setattr(module, "load", lambda name, namespace: description)
    monkeypatch.setattr(planning_scene_interface, "connect", lambda namespace: connection)
    monkeypatch.setattr(rospy.Time, "now", staticmethod(lambda: rospy.Time(7)))
    return connection


@pytest.fixture
def arm(connection):
    return move_group.MoveGroupCommander("arm")


@pytest.fixture
def success():
    return MoveItErrorCodes(MoveItErrorCodes.SUCCESS)
