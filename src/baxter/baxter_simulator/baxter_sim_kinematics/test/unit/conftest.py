# SPDX-License-Identifier: BSD-3-Clause
"""Baxter's model, as the tests of this package use it: the one that the lab runs."""
from pathlib import Path

import pytest

from arm_kinematics import Chain, OwnBody
from baxter_model.description import avoided_balls
from baxter_model.self_collision import FIRST_AVOIDING
from baxter_sim_kinematics.self_checker import self_checker
from model_files.resources import ResourceFinder
from urdf_model import parse_urdf

_BAXTER = Path(__file__).resolve().parents[4] / "baxter_common/baxter_description/urdf/baxter.urdf"


@pytest.fixture(scope="session")
def baxter_xml():
    # The expanded model is made by the workspace's set-up.
    return _BAXTER.read_text()


@pytest.fixture(scope="session")
def robot(baxter_xml):
    return parse_urdf(baxter_xml, source=str(_BAXTER))


@pytest.fixture(scope="session", params=["left", "right"])
def side(request):
    return request.param


@pytest.fixture(scope="session")
def chain(robot, side):
    return Chain.from_robot(robot, "base", side + "_gripper")


@pytest.fixture
def own_body(robot, chain):
    """Whether the robot can be in a posture of the arm, as the service asks it."""
    checker = self_checker(robot, ResourceFinder())
    yield OwnBody(chain, avoided_balls(robot), FIRST_AVOIDING, checker)
    checker.close()


@pytest.fixture(scope="session")
def left(robot):
    return Chain.from_robot(robot, "base", "left_gripper")
