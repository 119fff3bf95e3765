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
