# SPDX-License-Identifier: BSD-3-Clause
"""Baxter's arms, and one without redundancy."""
import numpy as np
import pytest

from arm_kinematics import Chain
from lab_testing.baxter import baxter_xml, robot, side
from urdf_model.transforms import rigid

__all__ = ["baxter_xml", "robot", "side"]


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
