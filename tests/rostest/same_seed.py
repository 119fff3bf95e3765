#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Two fresh /gazebo, stepped by the lock-step service with the same commands: joint states bit for bit, with all that a
physical robot has; and others with another seed."""
import sys
import unittest
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "bench"))

import lockstep_bench  # noqa: E402  (the bench is not an installed package)

TICKS = 250


class SameSeedTest(unittest.TestCase):
    def test_same_seed_same_bits(self):
        first, second, other = (lockstep_bench.run(TICKS, "all", seed) for seed in (7, 7, 8))
        self.assertGreaterEqual(first["states"], TICKS - 1)
        self.assertEqual(first, second)
        self.assertNotEqual(first["digest"], other["digest"], "noise does not follow from the seed")


if __name__ == "__main__":
    import rostest
    rostest.rosrun("workspace_tests", "same_seed", SameSeedTest)
