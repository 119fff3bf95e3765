# SPDX-License-Identifier: BSD-3-Clause
"""Every number of observations and actions has a name."""
import numpy as np
import pytest

from baxter_lab import Options
from baxter_model import SIDES
from gym_baxter import names
from gym_baxter.controls import CONTROLS, action_size
from gym_baxter.core import Choices, Core
from gym_baxter.tasks import TASKS

NAMED = [name for name, task in TASKS.items() if task.OBSERVED]


@pytest.mark.parametrize("control", CONTROLS)
def test_numbers_of_actions_have_names(control):
    assert len({name for name, _ in names.action_names(control, SIDES)}) == action_size(control)
    assert names.action_names(control, SIDES[::-1])[0][0].startswith("right_")


def test_an_unknown_control_is_refused():
    with pytest.raises(ValueError, match="joint_pos"):
        names.action_names("torque", SIDES)


@pytest.mark.parametrize("task", NAMED)
def test_numbers_of_observations_have_names(task):
    core = Core(task, Choices("osc_pose", options=Options(with_meshes=False)))
    robot = dict(zip([name for name, _ in names.robot_names(core.sides)], core.agent_pos(), strict=True))
    assert len(robot) == len(core.agent_pos())
    assert robot["left_gripper.open"] == pytest.approx(core.lab.robot.left.gripper.position / 100.0)
    assert robot["right_hand.z"] == pytest.approx(core.lab.robot.right.pose[2, 3])
    core.task.begin(np.random.default_rng(0))
    assert len(dict(core.task.OBSERVED)) == len(core.task.observed())
    core.close()
