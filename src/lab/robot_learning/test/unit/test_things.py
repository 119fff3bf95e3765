# SPDX-License-Identifier: BSD-3-Clause
"""The things of a task come into a simulator where its environment has them."""
from types import SimpleNamespace

import numpy as np
import pytest
from gazebo_msgs.srv import GetWorldProperties, SetModelState, SpawnModel

from baxter_model import BASE_HEIGHT_M
from gazebo_ros.gazebo_interface import GazeboInterfaceError
from gym_baxter.core import Core
from gym_baxter.tasks import STAGE_TASKS
from robot_learning.over_ros import scene, things


class FakeSimulator:
    """Answers of /gazebo as the real one gives them; places {model: (x, y, z)} in the world."""

    def __init__(self):
        self.places = {"ground_plane": (0.0, 0.0, 0.0)}

    def call(self, name, kind, *request):
        if kind is GetWorldProperties:
            return SimpleNamespace(model_names=list(self.places))
        if kind is SpawnModel:
            model, _, _, pose, _ = request
            if model in self.places:
                return SimpleNamespace(success=False, status_message="SpawnModel: Failure - entity already exists.")
            self.places[model] = (pose.position.x, pose.position.y, pose.position.z)
        elif kind is SetModelState:
            model, pose = request[0].model_name, request[0].pose
            if model not in self.places:
                return SimpleNamespace(success=False, status_message="model [%s] does not exist" % model)
            self.places[model] = (pose.position.x, pose.position.y, pose.position.z)
        return SimpleNamespace(success=True, status_message="")


@pytest.fixture
def simulator(monkeypatch):
    fake = FakeSimulator()
    monkeypatch.setattr(scene, "call", fake.call)
    monkeypatch.setattr(scene.rospy, "Subscriber", lambda *_, **__: None)
    monkeypatch.setattr(things, "RosRobot", lambda: None)
    return fake


def test_things_are_where_the_environment_has_them_and_move_with_the_seed(simulator):
    core = Core("PickPlace")
    try:
        for seed in (3, 4):
            said = things.put("PickPlace", seed)
            core.reset(np.random.default_rng(seed))
            x, y, z = core.task.block.position
            assert simulator.places["block"] == pytest.approx((x, y, z + BASE_HEIGHT_M), abs=1e-6)
            assert "x %.2f, y %.2f" % tuple(core.task.goal[:2]) in said
    finally:
        core.close()


@pytest.mark.parametrize("task", STAGE_TASKS)
def test_every_task_says_what_is_to_be_done(simulator, task):
    assert things.put(task, 0).startswith(STAGE_TASKS[task].SENTENCE)


def test_a_refusal_of_the_simulator_is_told(simulator, monkeypatch):
    monkeypatch.setattr(simulator, "places", {})
    real = simulator.call
    monkeypatch.setattr(scene, "call", lambda name, kind, *request: SimpleNamespace(
        success=False, status_message="no room") if kind is SpawnModel else real(name, kind, *request))
    with pytest.raises(GazeboInterfaceError, match="'table' cannot be spawned: no room"):
        things.put("PickPlace", 0)


@pytest.mark.parametrize("words", [["Lift"], ["PickPlace", "--seed", "-1"], []])
def test_wrong_words_are_refused(words, capsys):
    with pytest.raises(SystemExit):
        things.parse(words)
    assert "things: error:" in capsys.readouterr().err
