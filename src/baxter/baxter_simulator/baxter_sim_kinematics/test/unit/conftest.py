# SPDX-License-Identifier: BSD-3-Clause
"""Baxter's arms, and whether the robot can be in a posture."""
import pytest

from arm_kinematics import Chain, OwnBody
from baxter_model.description import avoided_balls
from baxter_model.self_collision import FIRST_AVOIDING
from baxter_sim_kinematics.self_checker import self_checker
from lab_testing.baxter import baxter_xml, robot, side
from model_files.resources import ResourceFinder

__all__ = ["baxter_xml", "robot", "side"]


@pytest.fixture(scope="session")
def chain(robot, side):
    return Chain.from_robot(robot, "base", side + "_gripper")


@pytest.fixture(scope="session")
def left(robot):
    return Chain.from_robot(robot, "base", "left_gripper")


@pytest.fixture
def own_body(robot, chain):
    """Whether the robot can be in a posture of the arm, as the service asks it."""
    checker = self_checker(robot, ResourceFinder())
    yield OwnBody(chain, avoided_balls(robot), FIRST_AVOIDING, checker)
    checker.close()
