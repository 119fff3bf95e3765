# SPDX-License-Identifier: BSD-3-Clause
"""The worlds of this package: everything in them is understood, and what lies on a table stays there."""
from pathlib import Path

import numpy as np
import pytest
import rospkg

from bullet_sim import Pose, World
from gazebo_ros.world_file import read_world
from model_files.resources import model_folders, model_sizes
from sdf_model import ModelFolders

WORLDS = sorted((Path(__file__).parents[2] / "worlds").glob("*.world"))
SECONDS = 2.0
# Plugins are not loaded here: the conveyor stands still.
STAYS_M, AT_REST = 0.003, 0.01


@pytest.mark.parametrize("path", WORLDS, ids=lambda path: path.stem)
def test_a_world_is_understood_and_at_rest(path):
    packages = rospkg.RosPack()
    described = read_world(path, ModelFolders(model_folders(packages), model_sizes(packages)))
    assert not described.warning and not described.problems
    assert (described.time_step_s, described.gravity) == (0.002, (0.0, 0.0, -9.81))
    world = World(time_step_s=described.time_step_s, gravity=described.gravity, warn=pytest.fail, error=pytest.fail)
    try:
        for model in described.models:
            world.spawn(model.robot, model.name, Pose.from_matrix(model.pose), static=model.static)
        free = [model for model in world.models.values() if not model.static]
        assert len(free) >= (0 if path.stem == "baxter" else 5)
        before = [np.asarray(model.link_pose(model.robot.root).position) for model in free]
        for _ in range(round(SECONDS / described.time_step_s)):
            world.step()
        for model, start in zip(free, before, strict=True):
            moved = np.abs(np.asarray(model.link_pose(model.robot.root).position) - start).max()
            assert moved < STAYS_M, "%s has moved by %.4f m" % (model.name, moved)
            assert np.abs(model.link_twist(model.robot.root)).max() < AT_REST, "%s moves" % model.name
    finally:
        world.close()


def test_the_launch_file_names_them_all():
    launch = (WORLDS[0].parents[1] / "launch" / "baxter_world.launch").read_text(encoding="utf-8")
    line = next(line for line in launch.splitlines() if '<arg name="world" ' in line)
    assert [path.stem for path in WORLDS if path.stem not in line] == []
