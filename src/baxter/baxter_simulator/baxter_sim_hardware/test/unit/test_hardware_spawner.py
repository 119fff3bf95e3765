# SPDX-License-Identifier: BSD-3-Clause
"""Messages of spawn_baxter when it cannot start."""
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path

import pytest

from baxter_model import SIDES, poses
from gazebo_ros import gazebo_interface

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "spawn_baxter"
WORDS = ["-urdf", "-param", "robot_description", "-model", "baxter"]


@pytest.fixture
def spawner(monkeypatch):
    """The script as a module, on a parameter server whose content is `parameters`."""
    loader = SourceFileLoader("spawn_baxter", str(SCRIPT))
    module = module_from_spec(spec_from_loader(loader.name, loader))
    loader.exec_module(module)
    module.parameters = {}
    monkeypatch.setattr(module.rospy, "has_param", lambda name: name in module.parameters)
    monkeypatch.setattr(module.rospy, "get_param", module.parameters.__getitem__)
    monkeypatch.setattr(module.rospy, "set_param", module.parameters.__setitem__)
    return module


def test_names_a_description_that_nobody_loaded(spawner, monkeypatch):
    monkeypatch.setattr(gazebo_interface.wait_until, "__defaults__", (0.1,))
    with pytest.raises(SystemExit, match="spawn_baxter: gave up .* the parameter robot_description"):
        spawner.main(["start", *WORDS])


def test_names_what_is_wrong_with_a_description(spawner):
    spawner.parameters["robot_description"] = "<robot"
    with pytest.raises(SystemExit, match="spawn_baxter: .*robot_description"):
        spawner.main(["start", *WORDS])


def test_lists_the_poses(spawner):
    spawner.parameters["robot_description"] = "<robot name='empty'><link name='base'/></robot>"
    with pytest.raises(SystemExit, match="unknown pose 'banana'; choices are start, neutral"):
        spawner.main(["banana", *WORDS])


@pytest.mark.parametrize("side", SIDES)
def test_a_joint_without_limits_starts_at_the_angle_of_the_pose(spawner, monkeypatch, side):
    joint = side + "_w2"
    spawner.parameters["robot_description"] = """<robot name="r"><link name="arm"/><link name="hand"/>
        <joint name="%s" type="continuous"><parent link="arm"/><child link="hand"/></joint></robot>""" % joint
    said = []
    monkeypatch.setattr(spawner.spawn_model, "main", said.extend)
    spawner.main(["neutral", *WORDS])
    assert said[said.index(joint) + 1] == repr(poses().angles("neutral", side)[joint])


def test_tells_where_the_arms_are_mounted(spawner, monkeypatch):
    spawner.parameters["robot_description"] = """<robot name="r"><link name="torso"/><link name="left_arm_mount"/>
        <joint name="left_torso_arm_mount" type="fixed"><origin xyz="0.02 0.21 0.11" rpy="0 0 0.7854"/>
        <parent link="torso"/><child link="left_arm_mount"/></joint></robot>"""
    monkeypatch.setattr(spawner.spawn_model, "main", lambda words: 0)
    monkeypatch.setattr(spawner, "joint_arguments", lambda pose, limits: [])
    spawner.main(["start", *WORDS])
    origin = "/robot_config/jcb_urdf_config/torso_t0/joint/left_torso_arm_mount/origin/"
    assert (spawner.parameters[origin + "xyz"], spawner.parameters[origin + "rpy"]) == ("0.02 0.21 0.11", "0 0 0.7854")
