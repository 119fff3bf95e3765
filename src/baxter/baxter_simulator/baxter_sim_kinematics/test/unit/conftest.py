# SPDX-License-Identifier: BSD-3-Clause
"""Baxter's model, as the tests of this package use it: the one that the lab runs."""
from pathlib import Path

import pytest

from baxter_sim_kinematics import Chain
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


@pytest.fixture(scope="session")
def left(robot):
    return Chain.from_robot(robot, "base", "left_gripper")
