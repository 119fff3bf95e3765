# SPDX-License-Identifier: BSD-3-Clause
"""The tasks can be done: by actions that a simple program chooses."""
import math

import numpy as np
import pytest

from baxter_lab import pose
from baxter_model import SIDES
from gym_baxter.core import Choices, Core

OPEN, CLOSE, UP_M = -1.0, 1.0, 0.12


class Expert:
    """Steers hands that point down, by joint positions."""

    def __init__(self, task):
        self.core = Core(task, Choices("joint_pos"))
        self._arms = self.core.lab.robot.arms

    def begin(self, seed):
        self.core.reset(np.random.default_rng(seed))
        self._angles = {side: arm.angles.copy() for side, arm in self._arms.items()}
        return self.core.task

    def go(self, hands, grip, steps):
        """Bring hands, {side: (place (3,), yaw)}, there within so many actions; the last result."""
        goal = {**self._angles, **{side: self._arms[side].ik(pose(place, (math.pi, 0.0, yaw)))
                                   for side, (place, yaw) in hands.items()}}
        begin = {side: arm.angles.copy() for side, arm in self._arms.items()}
        for step in range(steps):
            share, action = min((step + 1) / (0.7 * steps), 1.0), []
            for side in SIDES:
                chain = self._arms[side].chain
                q = begin[side] + share * (goal[side] - begin[side])
                action += [*(2.0 * (q - chain.lower) / (chain.upper - chain.lower) - 1.0), grip]
            stepped = self.core.step(action)
        self._angles = goal
        return stepped


@pytest.fixture
def expert(request):
    made = Expert(request.param)
    yield made
    made.core.close()


@pytest.mark.parametrize("expert", ["PickPlace"], indirect=True)
def test_a_block_is_put_onto_its_mark(expert):
    task, up = expert.begin(0), np.array((0.0, 0.0, UP_M))
    start, mark = task.block.position, task.goal
    yaw = math.atan2(task.block.pose[1, 0], task.block.pose[0, 0])
    for place, grip, steps in ((start + up, OPEN, 30), (start, OPEN, 20), (start, CLOSE, 15), (start + up, CLOSE, 15),
                               (mark + up, CLOSE, 30), (mark, CLOSE, 20), (mark, OPEN, 12), (mark + up, OPEN, 15)):
        stepped = expert.go({"left": (place, yaw)}, grip, steps)
    assert stepped.succeeded and stepped.reward > 0.8


@pytest.mark.parametrize("expert", ["TwoArmLift"], indirect=True)
def test_two_hands_lift_the_pot(expert):
    task = expert.begin(0)
    handles, matrix = task._handles(), task.pot.pose
    yaw = (math.atan2(matrix[1, 0], matrix[0, 0]) + math.pi / 2.0) % math.pi - math.pi / 2.0
    for height, grip, steps in ((UP_M, OPEN, 40), (0.0, OPEN, 25), (0.0, CLOSE, 20), (0.16, CLOSE, 40)):
        stepped = expert.go({side: (place + (0.0, 0.0, height), yaw) for side, place in handles.items()}, grip, steps)
    assert stepped.succeeded and stepped.reward == 1.0
