# SPDX-License-Identifier: BSD-3-Clause
"""The description from the parameter server; names that programs look for in the package."""
import pytest
import rospy

import moveit_commander
from moveit_commander import connection, description

URDF = """<robot name="one"><link name="base"/><link name="tool"/>
  <joint name="turn" type="revolute"><parent link="base"/><child link="tool"/><axis xyz="0 0 1"/>
    <limit lower="-2" upper="2" effort="1" velocity="1"/></joint></robot>"""
SRDF = '<robot name="one"><group name="arm"><joint name="turn"/></group></robot>'


@pytest.fixture
def parameters(monkeypatch):
    stored = {}
    monkeypatch.setattr(description, "ensure_node", lambda: None)
    monkeypatch.setattr(rospy, "get_param", lambda name, default=None: stored.get(name, default))
    monkeypatch.setattr(rospy, "search_param",
                        lambda name: next((full for full in ("/node/" + name, "/" + name) if full in stored), None))
    return stored


def test_a_description_with_all_that_belongs_to_it(parameters):
    parameters.update({
        "/robot_description": URDF, "/robot_description_semantic": SRDF,
        "/robot_description_planning": {"default_velocity_scaling_factor": 0.5, "joint_limits": {
            "turn": {"has_velocity_limits": True, "max_velocity": 0.7}}},
        "/robot_description_kinematics": {"arm": {"goal_joint_tolerance": 0.1}}})
    found = description.load("robot_description", "")
    assert found.model.velocity.tolist() == [0.7]
    assert (found.velocity_scaling, found.acceleration_scaling) == (0.5, 0.1)
    assert found.kinematics == {"arm": {"goal_joint_tolerance": 0.1}}
    assert description.load("robot_description", "").model is found.model


def test_a_description_in_the_namespace_of_move_group(parameters):
    parameters.update({"/one/robot_description": URDF, "/one/robot_description_semantic": SRDF})
    assert description.load("robot_description", "one").model.name == "one"
    assert description.load("/one/robot_description", "one").model.name == "one"


def test_what_is_missing_is_named(parameters):
    with pytest.raises(RuntimeError, match="no /robot_description and no /robot_description_semantic.*roslaunch"):
        description.load("robot_description", "")
    parameters.update({"/robot_description": URDF})
    with pytest.raises(RuntimeError, match="there is no /robot_description_semantic"):
        description.load("robot_description", "")
    parameters.update({"/robot_description_semantic": "<robot"})
    with pytest.raises(RuntimeError, match="Unable to construct robot model from /robot_description: "):
        description.load("robot_description", "")


def test_what_to_start_is_said(monkeypatch):
    for packages, said in ((["arm_moveit_config", "arm_gazebo", "leg_moveit_config"],
                            "roslaunch arm_moveit_config or leg_moveit_config move_group.launch"),
                           ([], "roslaunch ROBOT_moveit_config move_group.launch")):
        monkeypatch.setattr(connection.rospkg.RosPack, "list", lambda self, packages=packages: packages)
        assert said in connection.how_to_start()


def test_names_that_programs_rely_on():
    assert moveit_commander.os.getpid() > 0
    moveit_commander.roscpp_initialize(["program", "__name:=other"])
    moveit_commander.roscpp_shutdown()
    for name in ("MoveGroupCommander", "RobotCommander", "PlanningSceneInterface", "MoveItCommanderException",
                 "MoveGroupCommandInterpreter", "MoveGroupInfoLevel", "conversions"):
        assert name in moveit_commander.__all__
    from moveit_commander import (  # modules that are imported from
        exception,
        interpreter,
        move_group,
        roscpp_initializer,
    )
    assert move_group.MoveGroupCommander is moveit_commander.MoveGroupCommander
    assert exception and interpreter and roscpp_initializer.roscpp_shutdown
