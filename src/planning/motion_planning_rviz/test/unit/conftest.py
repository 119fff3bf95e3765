# SPDX-License-Identifier: BSD-3-Clause
"""Robots to plan for, and a client and a view without ROS."""
from pathlib import Path

import numpy as np
import pytest
import rospkg
from moveit_msgs.msg import AttachedCollisionObject, CollisionObject, RobotTrajectory
from trajectory_msgs.msg import JointTrajectoryPoint

import xacro
from motion_planning.kinematics import ik
from motion_planning.model import PlanningModel
from motion_planning_rviz.client import ActionOutcome, NoAnswer, NoPosture, SceneSnapshot
from motion_planning_rviz.panel import Panel

TWINS_URDF = """<robot name="twins">
  <link name="base"/>{arms}
</robot>"""
ARM_URDF = """
  <link name="{side}_upper"><visual><geometry><box size="0.1 0.1 0.4"/></geometry></visual></link>
  <link name="{side}_hand"><visual><geometry>
    <mesh filename="package://twins/hand.stl" scale="2 2 2"/></geometry></visual></link>
  <link name="{side}_tip"/><link name="{side}_finger"/>
  <joint name="{side}_turn" type="revolute"><origin xyz="0 {y} 0.5"/><parent link="base"/><child link="{side}_upper"/>
    <axis xyz="0 0 1"/><limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
  <joint name="{side}_reach" type="prismatic"><parent link="{side}_upper"/><child link="{side}_hand"/>
    <axis xyz="1 0 0"/><limit lower="0" upper="1" effort="1" velocity="1"/></joint>
  <joint name="{side}_end" type="fixed"><origin xyz="0.1 0 0"/><parent link="{side}_hand"/>
    <child link="{side}_tip"/></joint>
  <joint name="{side}_grip" type="prismatic"><parent link="{side}_tip"/><child link="{side}_finger"/><axis xyz="0 1 0"/>
    <limit lower="0" upper="0.02" effort="1" velocity="1"/></joint>"""
TWINS_SRDF = """<robot name="twins">
  <group name="left_arm"><chain base_link="base" tip_link="left_hand"/></group>
  <group name="right_arm"><chain base_link="base" tip_link="right_hand"/></group>
  <group name="both_arms"><group name="right_arm"/><group name="left_arm"/></group>
  <group name="left_gripper"><joint name="left_grip"/></group>
  <group_state name="out" group="left_arm"><joint name="left_turn" value="1"/><joint name="left_reach" value="0.5"/>
  </group_state>
  <end_effector name="left_eef" group="left_gripper" parent_link="left_tip" parent_group="left_arm"/>
</robot>"""


@pytest.fixture(scope="session")
def twins():
    """Two arms that turn and reach; the left one carries an end effector."""
    arms = "".join(ARM_URDF.format(side=side, y=y) for side, y in (("left", 0.5), ("right", -0.5)))
    return PlanningModel.from_xml(TWINS_URDF.format(arms=arms), TWINS_SRDF)


@pytest.fixture(scope="session")
def probot():
    packages = rospkg.RosPack()
    urdf = xacro.process_file(packages.get_path("probot_description") + "/urdf/probot_anno.xacro")
    srdf = Path(packages.get_path("probot_anno_moveit_config")) / "config/probot_anno.srdf"
    return PlanningModel.from_xml(urdf.toxml(), srdf.read_text())


class FakeClient:
    """A move_group that is asked directly. touching: Touches of every state; robot: {joint: value},
    and whether they are measured."""

    def __init__(self, model):
        self.model, self.robot = model, {}
        self.touching, self.objects, self.attached = [], [], []
        self.sent, self.stopped, self.missing, self.asked, self.is_measured = [], 0, False, [], True

    def snapshot(self):
        self._check()
        return SceneSnapshot(self.robot, list(self.objects), list(self.attached), {}, self.is_measured)

    def _check(self):
        if self.missing:
            raise NoAnswer("service /get_planning_scene does not answer")

    def posture(self, handle, pose, state, avoid):
        self.asked.append((handle, pose, avoid))
        try:
            q = ik(self.model, handle.group, {handle.link: pose}, state)
        except ValueError:
            raise NoPosture("NO_IK_SOLUTION") from None
        return dict(zip(self.model.variables, q.tolist(), strict=True))

    def validity(self, group, state):
        touches = self.touching(state) if callable(self.touching) else self.touching
        return not touches and not self.model.beyond_limits(state.q), touches

    def planners(self, group):
        return (("ompl", "RRTConnect"), ("pilz", "PTP"))

    def add_box(self, name, size, pose):
        self.objects.append(CollisionObject(id=name))
        self.asked.append((name, size, pose))

    def remove(self, name):
        self.objects = [one for one in self.objects if one.id != name]

    def attach(self, name, link, touch_links):
        self.remove(name)
        self.attached.append(AttachedCollisionObject(link_name=link, object=CollisionObject(id=name),
                                                     touch_links=touch_links))

    def detach(self, name, link):
        assert [one.link_name for one in self.attached if one.object.id == name] == [link]
        self.attached = [one for one in self.attached if one.object.id != name]
        self.objects.append(CollisionObject(id=name))

    def plan(self, query, execute, done):
        self._check()
        self.sent.append(("plan", query, execute, done))

    def execute(self, trajectory, done):
        self.sent.append(("execute", trajectory, done))

    def stop(self):
        self.stopped += 1


class FakeView:
    """Remembers what it was told to show."""

    def __init__(self):
        self.ghosts, self.poses, self.entries, self.lines, self.seen = {}, {}, [], [], []

    def group(self, name, handles):
        self.poses.clear()

    def ghost(self, which, state, touches, attached, unreached):
        self.ghosts[which] = (state, touches, attached, unreached)

    def clear(self, which):
        self.ghosts.pop(which, None)
        self.poses = {key: pose for key, pose in self.poses.items() if key[0] != which}

    def place(self, which, poses):
        self.poses.update({(which, handle.link): pose for handle, pose in poses.items()})

    def menu(self, entries):
        self.entries = entries

    def say(self, motion, notes):
        self.lines = [line for line in (motion, *notes) if line]

    def scene(self, snapshot):
        self.seen.append("scene")

    def show_path(self, shown):
        self.seen.append(("path", shown))

    def forget_path(self):
        self.seen.append("no path")


class AtOnce:
    """A worker that does everything in the caller's thread."""

    def put(self, function, key=None):
        function()


@pytest.fixture(scope="session")
def trajectory():
    """Function of times [s] that returns a RobotTrajectory with empty points at these."""
    def build(*times):
        message = RobotTrajectory()
        for seconds in times:
            point = JointTrajectoryPoint()
            point.time_from_start.secs = int(seconds)
            point.time_from_start.nsecs = int(1e9 * (seconds - int(seconds)))
            message.joint_trajectory.points.append(point)
        return message
    return build


@pytest.fixture(scope="session")
def planned(trajectory):
    """Function of times [s] that returns the ActionOutcome of a plan with points at these."""
    return lambda *times: ActionOutcome(True, "", trajectory(*times), 0.0123)


@pytest.fixture
def panel_of():
    def build(model, group=""):
        panel = Panel(model, FakeClient(model), FakeView(), AtOnce(), np.random.default_rng(1))
        panel.begin(group, 0.5)
        return panel
    return build
