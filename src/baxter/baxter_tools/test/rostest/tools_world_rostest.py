#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""tare.py, calibrate_arm.py, camera_control.py and smoke_test.py on the simulated robot."""
import pathlib
import subprocess
import tempfile
import unittest

import rospy
from sensor_msgs.msg import Image

from lab_testing.waiting import stretched

DEADLINE_S = stretched(120.0)


class ToolsWorldTest(unittest.TestCase):
    def run_tool(self, *command, folder=None):
        result = subprocess.run(["rosrun", "baxter_tools", *command], stdin=subprocess.DEVNULL, capture_output=True,
                                text=True, timeout=DEADLINE_S, cwd=folder)
        self.assertEqual(result.returncode, 0, result.stdout + result.stderr)
        return result.stdout + result.stderr

    def test_bare_arm_is_tared_and_calibrated(self):
        for tool, name in (("tare.py", "Tare"), ("calibrate_arm.py", "CalibrateArm")):
            self.assertIn("%s of the left arm is complete" % name, self.run_tool(tool, "-l", "left"))

    def test_camera_opens_at_a_resolution_and_closes(self):
        name = "left_hand_camera"
        self.assertIn(name, self.run_tool("camera_control.py", "-l"))
        self.run_tool("camera_control.py", "-o", name, "-r", "320x200")
        self.assertIn(name + " - (open)", self.run_tool("camera_control.py", "-l"))
        image = rospy.wait_for_message("/cameras/%s/image" % name, Image, DEADLINE_S)
        self.assertEqual((image.width, image.height), (320, 200))
        self.run_tool("camera_control.py", "-c", name)
        self.assertNotIn(name + " - (open)", self.run_tool("camera_control.py", "-l"))

    def test_smoke_tests_pass_and_are_logged(self):
        folder = self.enterContext(tempfile.TemporaryDirectory())
        for name in ("Messages", "Services"):
            self.assertIn("--- %s: passed" % name, self.run_tool("smoke_test.py", "-t", name, folder=folder))
        log, = pathlib.Path(folder).glob("SIM-BAXTER-*.smoketest")
        self.assertEqual(log.read_text().count("all passed"), 2)


if __name__ == "__main__":
    import rostest
    rospy.init_node("tools_world_rostest")
    rostest.rosrun("baxter_tools", "tools_world", "__main__")
