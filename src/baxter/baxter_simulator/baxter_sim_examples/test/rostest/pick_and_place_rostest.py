#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The demo carries its block: lifted, held by two fingers, put down where it should be."""
import math
import threading
import unittest

import rospy
from baxter_core_msgs.msg import EndEffectorState
from gazebo_msgs.msg import ModelStates

from baxter_dataflow import wait_for
from baxter_interface.startup import init_node
from baxter_sim_examples import BASE_HEIGHT_M, TABLE_TOP_M, Trial

DEADLINE_S = 150.0  # [simulated s]; it takes 12
LIFTED_M = TABLE_TOP_M + 0.1


class Block:
    """The history of the block and of the hand."""

    def __init__(self):
        self._lock = threading.Lock()
        self._gripping = False
        self._path = []  # (x, y, z, whether the hand said that it holds something)
        self._is_there = False
        self._gripper = rospy.Subscriber("/robot/end_effector/left_gripper/state", EndEffectorState, self._on_gripper)
        self._models = rospy.Subscriber("/gazebo/model_states", ModelStates, self._on_models)

    @property
    def was_removed(self):
        """Whether it was spawned and deleted, as when the demo ends."""
        with self._lock:
            return bool(self._path) and not self._is_there

    def path(self):
        with self._lock:
            return list(self._path)

    def _on_gripper(self, message):
        self._gripping = message.gripping == 1

    def _on_models(self, message):
        with self._lock:
            self._is_there = "block" in message.name
            if self._is_there:
                at = message.pose[message.name.index("block")].position
                self._path.append((at.x, at.y, at.z, self._gripping))


class PickAndPlaceTest(unittest.TestCase):
    def test_block_is_lifted_and_put_down_on_its_target(self):
        block, trial = Block(), Trial.from_seed(rospy.get_param("/ik_pick_and_place_demo/seed"))
        wait_for(lambda: block.was_removed, DEADLINE_S, timeout_msg="the demo did not end, and take its block away")
        path = block.path()
        aloft = [held for _, _, z, held in path if z > LIFTED_M]
        self.assertTrue(aloft, "the block was never lifted")
        # Messages of two topics overtake each other, but not for long.
        self.assertGreater(sum(aloft), 0.9 * len(aloft))
        target = (trial.target.x, trial.target.y, trial.target.z + BASE_HEIGHT_M)
        self.assertLess(math.dist(path[-1][:3], target), 0.01)
        self.assertFalse(path[-1][3], "the hand holds it still")


if __name__ == "__main__":
    import rostest
    init_node("pick_and_place_rostest")
    rostest.rosrun("baxter_sim_examples", "pick_and_place", "__main__")
