# SPDX-License-Identifier: BSD-3-Clause
"""The arm's xacro against its figures: frames, axes, limits, the zero pose; masses, shapes, transmissions, plugin."""
from pathlib import Path

import numpy as np
import pytest
import roslaunch.config
import roslib.packages

import xacro
from urdf_model import Mesh, parse_urdf
from urdf_model.transforms import pose_matrix

PACKAGE = Path(__file__).resolve().parents[2]
# Joint: parent, child, origin [m], rpy [rad], axis, lower, upper [rad]: the arm's figures.
FIGURES = {
    "joint_1": ("base_link", "link_1", (0, 0, 0.0315), (1.5708, 0, 0), (0, 1, 0), -3.1416, 3.1416),
    "joint_2": ("link_1", "link_2", (0, 0.2305, 0), (0, 0, 0), (0, 0, 1), -2.0071, 2.0071),
    "joint_3": ("link_2", "link_3", (0, 0.225, 0), (0, 0, 0), (0, 0, 1), -0.6981, 3.8397),
    "joint_4": ("link_3", "link_4", (0.023, 0, 0), (0, 0, 0), (1, 0, 0), -3.1416, 3.1416),
    "joint_5": ("link_4", "link_5", (0.20585535, 0, 0), (0, 0, 0), (0, 0, 1), -0.7854, 3.9270),
    "joint_6": ("link_5", "link_6", (0, -0.042, 0), (1.5708, 0, 0), (0, 0, 1), -3.1416, 3.1416),
}
# The data have right angles with four digits.
ANGLE_DIGITS = 1e-5


def expand(**arguments):
    file = PACKAGE / "urdf" / "probot_anno.xacro"
    return parse_urdf(xacro.process_file(str(file), mappings=arguments).toxml(), source=str(file))


@pytest.fixture(scope="module")
def robot():
    return expand()


def rotation(axis, angle):
    """(3, 3) rotation by Rodrigues' formula, independent of the package under test."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def tip(robot, angles):
    """(4, 4): tool0 in base_link with the six joints at `angles` [rad]."""
    pose, angles = np.eye(4), iter(angles)
    for joint in robot.chain("base_link", "tool0"):
        turn = np.eye(4)
        if joint.movable:
            turn[:3, :3] = rotation(joint.axis, next(angles))
        pose = pose @ joint.origin @ turn
    return pose


def test_description_has_no_warnings(robot):
    assert robot.warnings == []
    assert robot.name == "probot_anno"


def test_chain_has_the_names_of_the_figures(robot):
    assert [joint.name for joint in robot.movable_joints()] == list(FIGURES)
    assert [joint.name for joint in robot.chain("base_link", "tool0")] == [*FIGURES, "joint_tool0"]


@pytest.mark.parametrize("name", FIGURES)
def test_joint_has_the_figures(robot, name):
    parent, child, xyz, rpy, axis, lower, upper = FIGURES[name]
    joint = robot.joints[name]
    assert (joint.type, joint.parent, joint.child) == ("revolute", parent, child)
    assert joint.origin == pytest.approx(pose_matrix(xyz, rpy))
    assert joint.axis == pytest.approx(axis)
    assert (joint.limit.lower, joint.limit.upper) == (lower, upper)
    assert (joint.limit.velocity, joint.limit.effort) == (3.0, 100.0)


# Worked out by hand from the figures: heights 0.0315 + 0.2305 + 0.225, forearm 0.023 + 0.20585535, wrist 0.042 + 0.013.
@pytest.mark.parametrize("angles, xyz, z_axis", [
    ((0, 0, 0, 0, 0, 0), (0.22885535, 0, 0.432), (0, 0, 1)),
    ((np.pi / 2, 0, 0, 0, 0, 0), (0, 0.22885535, 0.432), (0, 0, 1)),
    ((0, 0, np.pi / 2, 0, np.pi / 2, 0), (0, 0, 0.487 + 0.22885535 + 0.055), (0, 0, -1)),  # all in one line, upwards
    ((0, -np.pi / 2, 0, 0, 0, 1.0), (0.225 - 0.055, 0, 0.262 - 0.22885535), (1, 0, 0)),
    ((0, 0, 0, np.pi / 2, 0, 0), (0.22885535, 0.055, 0.487), (0, -1, 0)),  # joint_4 turns the wrist about x
])
def test_tip_is_where_the_figures_say(robot, angles, xyz, z_axis):
    pose = tip(robot, angles)
    assert pose[:3, 3] == pytest.approx(xyz, abs=ANGLE_DIGITS)
    assert pose[:3, 2] == pytest.approx(z_axis, abs=2 * ANGLE_DIGITS)


def test_base_is_held_to_the_ground(robot):
    assert robot.root == "world"
    assert robot.chain("world", "base_link")[0].type == "fixed"
    assert robot.chain("world", "base_link")[0].origin == pytest.approx(np.eye(4))


@pytest.mark.parametrize("name", ["base_link", *("link_%d" % number for number in range(1, 7))])
def test_link_can_be_simulated_and_seen(robot, name):
    link = robot.links[name]
    assert 0.01 < link.inertial.mass < 5.0
    moments = np.linalg.eigvalsh(link.inertial.inertia)
    assert moments[0] > 0 and moments[0] + moments[1] > moments[2], "no solid body has these moments of inertia"
    # No link spreads further than the longest one, 0.3 m.
    assert moments[2] < link.inertial.mass * 0.15**2
    assert link.visuals and len(link.visuals) == len(link.collisions)
    assert all(shape.colour for shape in link.visuals)
    assert not any(isinstance(shape.geometry, Mesh) for shape in link.visuals + link.collisions)


def test_readme_gives_the_total_mass(robot):
    total = sum(link.inertial.mass for link in robot.links.values() if link.inertial)
    assert "%.2f kg in all" % total in (PACKAGE / "README.md").read_text()


def test_every_joint_has_a_position_transmission(robot):
    driven = {joint.name: joint.hardware_interfaces for item in robot.transmissions for joint in item.joints}
    assert driven == dict.fromkeys(FIGURES, ("hardware_interface/PositionJointInterface",))
    assert {item.type for item in robot.transmissions} == {"transmission_interface/SimpleTransmission"}
    assert all(item.reductions == (1.0,) for item in robot.transmissions)


@pytest.mark.parametrize("arguments, namespace", [({}, "/probot_anno"), ({"robot_namespace": "/left"}, "/left")])
def test_plugin_has_the_namespace(arguments, namespace):
    plugins = [plugin for element in expand(**arguments).gazebo for plugin in element.findall("plugin")]
    assert [plugin.get("filename") for plugin in plugins] == ["libgazebo_ros_control.so"]
    settings = {child.tag: child.text for child in plugins[0]}
    assert settings == {"robotNamespace": namespace, "robotSimType": "gazebo_ros_control/DefaultRobotHWSim",
                        "legacyModeNS": "true"}


def test_view_launch_finds_what_it_starts():
    config = roslaunch.config.load_config_default([str(PACKAGE / "launch" / "view_probot_anno.launch")], None)
    for node in config.nodes:
        assert roslib.packages.find_node(node.package, node.type), "%s/%s" % (node.package, node.type)
    assert config.params["/robot_description"].value.count("<joint ") >= 7
