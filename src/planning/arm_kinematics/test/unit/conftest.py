# SPDX-License-Identifier: BSD-3-Clause
"""Baxter's model, as the tests of this package use it: the one that the lab runs."""
from pathlib import Path

import numpy as np
import pytest

from arm_kinematics import Chain
from urdf_model import parse_urdf
from urdf_model.transforms import rigid

_BAXTER = Path(__file__).resolve().parents[4] / "baxter/baxter_common/baxter_description/urdf/baxter.urdf"


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


@pytest.fixture(scope="session")
def six_axes():
    """A desk arm without redundancy: shoulder, elbow and a wrist with an offset; lengths [m] of the order of a
    PROBOT's.
    """
    links = [((0, 0, 0.03), (0, 0, 1), 3.1), ((0, 0, 0.1), (0, 1, 0), 2.0), ((0, 0, 0.23), (0, 1, 0), 2.4),
             ((0, 0, 0.1), (0, 0, 1), 3.1), ((0.02, 0, 0.13), (0, 1, 0), 2.0), ((0, 0.04, 0.05), (0, 0, 1), 3.1)]
    steps = [("joint_%d" % (i + 1), "revolute", "link_%d" % (i + 1), rigid(np.eye(3), origin), axis, -limit, limit)
             for i, (origin, axis, limit) in enumerate(links)]
    steps.append(("tool", "fixed", "tool0", rigid(np.eye(3), (0, 0, 0.05)), (0, 0, 1), None, None))
    return Chain("base", "tool0", steps)
