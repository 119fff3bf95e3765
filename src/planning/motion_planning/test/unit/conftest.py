# SPDX-License-Identifier: BSD-3-Clause
"""Robots that the tests of this package plan for: small ones of their own, and those that the lab has."""
from pathlib import Path

import pytest
import rospkg

import xacro
from motion_planning.model import MeshReader, PlanningModel

GROUPS = """
<virtual_joint name="world_joint" type="floating" parent_frame="world" child_link="base"/>
<group name="left_arm"><chain base_link="torso" tip_link="left_gripper"/></group>
<group name="right_arm"><chain base_link="torso" tip_link="right_gripper"/></group>
<group name="both_arms"><group name="right_arm"/><group name="left_arm"/></group>
<group name="left_hand"><chain base_link="left_hand" tip_link="left_gripper"/></group>
<group_state name="left_neutral" group="left_arm">
  <joint name="left_s0" value="0"/><joint name="left_s1" value="-0.55"/><joint name="left_e0" value="0"/>
  <joint name="left_e1" value="0.75"/><joint name="left_w0" value="0"/><joint name="left_w1" value="1.26"/>
  <joint name="left_w2" value="0"/>
</group_state>
<end_effector name="left_hand_eef" group="left_hand" parent_link="left_gripper" parent_group="left_arm"/>
<passive_joint name="world_joint"/>
"""


MIX_URDF = """<robot name="mix">
  <link name="base"/><link name="turret"/><link name="slide"/><link name="finger"/><link name="thumb"/>
  <link name="eye"/>
  <joint name="turn" type="continuous"><origin xyz="0 0 0.5" rpy="0 0 1"/><parent link="base"/><child link="turret"/>
    <axis xyz="0 1 1"/></joint>
  <joint name="look" type="fixed"><origin xyz="0 0 1"/><parent link="base"/><child link="eye"/></joint>
  <joint name="push" type="prismatic"><parent link="turret"/><child link="slide"/><axis xyz="1 0 0"/>
    <limit lower="0.1" upper="0.3" effort="1" velocity="0.4"/></joint>
  <joint name="grip" type="revolute"><origin xyz="0 0.1 0"/><parent link="slide"/><child link="finger"/>
    <axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="0"/></joint>
  <joint name="oppose" type="revolute"><origin xyz="0 -0.1 0"/><parent link="slide"/><child link="thumb"/>
    <axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="2"/>
    <mimic joint="grip" multiplier="-2" offset="0.25"/></joint>
</robot>"""
MIX_SRDF = """<robot name="mix">
  <group name="arm"><chain base_link="base" tip_link="slide"/></group>
  <group name="hand"><joint name="grip"/><link name="thumb"/></group>
  <group name="listed"><joint name="push"/><joint name="turn"/></group>
  <group name="ends"><joint name="grip"/><joint name="look"/></group>
  <group_state name="out" group="arm"><joint name="push" value="0.3"/><joint name="grip" value="1"/></group_state>
  <group_state name="fist" group="hand"><joint name="grip" value="1"/><joint name="oppose" value="-1.75"/></group_state>
  <disable_collisions link1="turret" link2="base" reason="Adjacent"/>
  <disable_default_collisions link="eye"/>
  <enable_collisions link1="finger" link2="eye"/>
</robot>"""


@pytest.fixture(scope="session")
def mix_texts():
    """URDF and SRDF of a small robot with a joint of each kind, and one that mimics another."""
    return MIX_URDF, MIX_SRDF


@pytest.fixture(scope="session")
def mix(mix_texts):
    return PlanningModel.from_xml(*mix_texts)


@pytest.fixture(scope="session")
def packages():
    return rospkg.RosPack()


@pytest.fixture(scope="session")
def baxter_xml(packages):
    # The expanded model is made by the workspace's set-up.
    return (Path(packages.get_path("baxter_description")) / "urdf/baxter.urdf").read_text()


@pytest.fixture(scope="session")
def baxter(baxter_xml):
    return PlanningModel.from_xml(baxter_xml, "<robot name='baxter'>%s</robot>" % GROUPS)


@pytest.fixture(scope="session")
def probot(packages):
    urdf = xacro.process_file(packages.get_path("probot_description") + "/urdf/probot_anno.xacro")
    srdf = Path(packages.get_path("probot_anno_moveit_config")) / "config/probot_anno.srdf"
    return PlanningModel.from_xml(urdf.toxml(), srdf.read_text())


@pytest.fixture(scope="session")
def meshes(packages):
    def find(name):
        package, _, path = name.partition("package://")[2].partition("/")
        return Path(packages.get_path(package)) / path

    return MeshReader(find)
