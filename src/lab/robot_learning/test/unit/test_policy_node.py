# SPDX-License-Identifier: BSD-3-Clause
"""The node `policy`: what it refuses before it needs a master."""
from types import SimpleNamespace

import pytest

from gym_baxter.tasks import STAGE_TASKS, TASKS
from robot_learning.driving import DrivingLimits
from robot_learning.over_ros.node import PolicyNode
from robot_learning.policy import Contract, PolicyError


@pytest.mark.parametrize("task", sorted(set(TASKS) - set(STAGE_TASKS)))
def test_a_task_that_needs_the_simulator_in_its_own_process_is_refused(task):
    """Its joints, contacts or tools are not on topics: the node ended with a TypeError or an AttributeError."""
    policy = SimpleNamespace(contract=Contract(task, "osc_pose", 20, (), (), (), 1))
    with pytest.raises(PolicyError, match="%s; on a ROS master there are Reach, PickPlace" % task):
        PolicyNode(policy, DrivingLimits(), lock_step=False, without_switch=False)
