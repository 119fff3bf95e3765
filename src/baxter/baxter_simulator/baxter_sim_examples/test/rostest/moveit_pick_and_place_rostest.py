#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""A block is carried through clutter by what MoveIt's interface offers; nothing else is touched."""
import unittest

from baxter_interface.startup import init_node
from baxter_sim_examples.moveit_trial import MISS_M, MoveItTrials


class MoveItPickAndPlaceTest(unittest.TestCase):
    def test_blocks_arrive_and_nothing_else_is_touched(self):
        trials = MoveItTrials()
        for seed in (0, 1):
            with self.subTest(seed=seed):
                self.assertLess(trials.run(seed), MISS_M)


if __name__ == "__main__":
    import rostest
    init_node("moveit_pick_and_place_rostest")
    rostest.rosrun("baxter_sim_examples", "moveit_pick_and_place", MoveItPickAndPlaceTest)
