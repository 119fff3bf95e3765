# SPDX-License-Identifier: BSD-3-Clause
"""The launch files start the right nodes in the right namespaces; the controllers' joints are the URDF's."""
from pathlib import Path

import pytest
import roslaunch.config
import roslib.packages
import yaml
from lxml import etree

from urdf_model import parse_urdf

PACKAGE = Path(__file__).resolve().parents[2]
JOINTS = ["joint_%d" % number for number in range(1, 7)]
PREFIX = "probot_anno_"
WORLD, STATES, TRAJECTORY, BRINGUP = LAUNCH_FILES = [
    PREFIX + name + ".launch" for name in ("gazebo_world", "gazebo_states", "trajectory_controller", "bringup_moveit")]


def path_of(name):
    return PACKAGE / "launch" / "probot_anno" / name


def load(name, *arguments):
    return roslaunch.config.load_config_default([(str(path_of(name)), list(arguments))], None)


def values(config):
    return {name: param.value for name, param in config.params.items()}


def started(config):
    """{full node name: (package, executable, arguments)}."""
    return {node.namespace + node.name: (node.package, node.type, node.args.split()) for node in config.nodes}


@pytest.mark.parametrize("name", LAUNCH_FILES)
def test_launch_file_finds_what_it_starts(name):
    for node in load(name).nodes:
        assert roslib.packages.find_node(node.package, node.type), "%s/%s" % (node.package, node.type)


@pytest.mark.parametrize("name", LAUNCH_FILES)
def test_every_argument_is_explained(name):
    for argument in etree.parse(str(path_of(name))).iterfind("/arg"):
        assert argument.get("doc"), argument.get("name")


def test_world_has_the_arguments_of_gazebos_launch_files():
    defaults = {item.get("name"): item.get("default") for item in etree.parse(str(path_of(WORLD))).iterfind("/arg")}
    assert defaults == {
        "paused": "false", "use_sim_time": "true", "gui": "true", "headless": "false", "debug": "false"}


def test_world_spawns_the_described_arm():
    config = load(WORLD)
    assert started(config)["/urdf_spawner"] == (
        "gazebo_ros", "spawn_model", "-urdf -model probot_anno -param robot_description".split())
    assert values(config)["/use_sim_time"] is True
    robot = parse_urdf(values(config)["/robot_description"])
    assert [joint.name for joint in robot.movable_joints()] == JOINTS


def test_states_are_published_and_reach_tf():
    config = load(STATES)
    assert values(config)["/probot_anno/joint_state_controller/type"] == "joint_state_controller/JointStateController"
    assert values(config)["/probot_anno/joint_state_controller/publish_rate"] == 50
    assert started(config)["/probot_anno/joint_controller_spawner"] == (
        "controller_manager", "spawner", ["joint_state_controller"])
    (publisher,) = (node for node in config.nodes if node.name == "robot_state_publisher")
    assert publisher.remap_args == [["/joint_states", "/probot_anno/joint_states"]]


def test_trajectory_controller_has_all_joints_and_their_gains():
    config = load(TRAJECTORY)
    controller = yaml.safe_load((PACKAGE / "config" / "probot_anno_trajectory_control.yaml").read_text())
    controller = controller["probot_anno"]["arm_joint_controller"]
    assert controller == {"type": "position_controllers/JointTrajectoryController", "joints": JOINTS,
                          "gains": dict.fromkeys(JOINTS, {"p": 1000.0, "i": 0.0, "d": 0.1, "i_clamp": 0.0})}
    assert values(config)["/probot_anno/arm_joint_controller/joints"] == JOINTS
    assert started(config) == {
        "/probot_anno/arm_controller_spawner": ("controller_manager", "spawner", ["arm_joint_controller"])}


def test_bringup_starts_all_of_it():
    nodes = started(load(BRINGUP))
    for name in (WORLD, STATES, TRAJECTORY):
        assert started(load(name)).items() <= nodes.items()
    assert nodes["/joint_states_relay"] == ("topic_tools", "relay", ["/probot_anno/joint_states", "/joint_states"])
    assert {"/move_group", "/rviz"} <= nodes.keys()


def test_bringup_without_windows():
    assert not {"/rviz", "/gazebo_gui"} & started(load(BRINGUP, "rviz:=false", "gui:=false")).keys()
