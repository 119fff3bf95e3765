#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""`sysid` without a recording comes to its end on the simulated robot, and writes the numbers that the robot has."""
import subprocess
import tempfile
import unittest
from pathlib import Path

import rospy

from baxter_interface import RobotEnable
from baxter_sim_hardware import effects
from baxter_sysid.recording import ArmRecording
from lab_testing.waiting import stretched

SIDE = "left"
LIMIT_S = 600.0


class LiveFitTest(unittest.TestCase):
    def test_it_comes_to_its_end_and_writes_the_numbers(self):
        RobotEnable().enable()
        with tempfile.TemporaryDirectory() as folder:
            out, kept = Path(folder) / "own.yaml", Path(folder) / "arm.csv"
            done = subprocess.run(["rosrun", "baxter_sysid", "sysid", "--arm", SIDE, "--seconds", "10", "--yes",
                                   "--out", str(out), "--keep", str(kept)], capture_output=True, text=True,
                                  timeout=stretched(LIMIT_S))
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertIn("proportional_gain of s0", done.stdout)
            found = effects.read(out)["lag"]["proportional_gain"]["%s_s0" % SIDE]
            usual = effects.read(effects.physical_robot())["lag"]["proportional_gain"]["s0"]
            self.assertLess(abs(found / usual - 1.0), 0.05)
            self.assertGreater(len(ArmRecording.read(kept).time_s), 1500)


if __name__ == "__main__":
    import rostest

    rospy.init_node("sysid_live_fit_test")
    rostest.rosrun("baxter_sysid", "sysid_live_fit", LiveFitTest)
