# SPDX-License-Identifier: BSD-3-Clause
"""A small robot, and its scene."""
import pytest
import rospy

from motion_planning.model import PlanningModel
from motion_planning.scene import Scene

URDF = """<robot name="crane">
  <link name="base"/><link name="arm"><collision><geometry><box size="0.1 0.1 0.4"/></geometry></collision></link>
  <link name="hand"/><link name="counterweight"/>
  <joint name="turn" type="revolute"><origin xyz="0 0 0.5"/><parent link="base"/><child link="arm"/>
    <axis xyz="0 0 1"/><limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
  <joint name="reach" type="prismatic"><parent link="arm"/><child link="hand"/><axis xyz="1 0 0"/>
    <limit lower="0" upper="1" effort="1" velocity="1"/></joint>
  <joint name="balance" type="prismatic"><parent link="arm"/><child link="counterweight"/><axis xyz="1 0 0"/>
    <limit lower="-1" upper="0" effort="1" velocity="1"/><mimic joint="reach" multiplier="-0.5" offset="-0.1"/></joint>
</robot>"""
SRDF = """<robot name="crane">
  <virtual_joint name="world_joint" type="floating" parent_frame="world" child_link="base"/>
  <group name="arm"><chain base_link="base" tip_link="hand"/></group>
</robot>"""


@pytest.fixture(autouse=True)
def wall_time(monkeypatch):
    """ROS time without a node, also after tests of a simulator in the same process, whose time stands still."""
    monkeypatch.setattr(rospy.rostime, "_rostime_initialized", True)
    monkeypatch.setattr(rospy.rostime, "_rostime_current", None)


@pytest.fixture(scope="session")
def texts():
    """URDF and SRDF of the robot."""
    return URDF, SRDF


@pytest.fixture(scope="session")
def model(texts):
    return PlanningModel.from_xml(*texts)


@pytest.fixture
def scene(model):
    return Scene(model, model.state({"turn": 0.5, "reach": 0.2}))
