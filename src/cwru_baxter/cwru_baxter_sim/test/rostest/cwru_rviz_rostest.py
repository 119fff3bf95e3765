#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The picture of the notes: rviz with the robot, and before it the points of the table and of the can."""
import os
import signal
import subprocess
import time
import unittest
from pathlib import Path

import numpy as np
import rospy

from lab_testing.virtual_screen import VirtualScreen

SCENE_COLUMNS = slice(380, 1150)  # right of the panels


class CwruRvizTest(unittest.TestCase):
    def setUp(self):
        self.screen = VirtualScreen()
        self.addCleanup(self.screen.close)
        self.lab = subprocess.Popen(["roslaunch", "cwru_baxter_sim", "baxter_world.launch", "gui:=false", "rviz:=true"],
                                    env=self.screen.environment, start_new_session=True)
        self.addCleanup(self.end_lab)

    def end_lab(self):
        if self.lab.poll() is None:
            os.killpg(self.lab.pid, signal.SIGINT)
            self.lab.wait(20.0)

    def test_table_and_can_are_in_front_of_the_robot(self):
        deadline = time.monotonic() + 200.0
        counts = {}
        while time.monotonic() < deadline:
            picture = self.screen.picture()
            red, green, blue = (picture[:, SCENE_COLUMNS, k].astype(int) for k in range(3))
            counts = {"table": np.count_nonzero((red > 120) & (abs(red - 1.45 * green) < 25) & (blue < 0.75 * green)),
                      "can": np.count_nonzero((green > 2 * red) & (green > 1.5 * blue) & (green > 25)),
                      "robot": np.count_nonzero((red > 100) & (green < 40) & (blue < 40))}
            if counts["table"] > 5000 and counts["can"] > 50 and counts["robot"] > 2000:
                self.keep(picture)
                return
            time.sleep(0.5)
        self.keep(picture)
        self.fail("the picture does not fill; pixels of each: %s" % counts)

    def keep(self, picture):
        """Leave the picture beside the test's other results, for whoever wants to look."""
        folder = os.environ.get("ROS_TEST_RESULTS_DIR")
        if folder:
            height, width, _ = picture.shape
            (Path(folder) / "cwru_rviz.ppm").write_bytes(b"P6 %d %d 255\n" % (width, height) + picture.tobytes())


if __name__ == "__main__":
    import rostest
    rospy.init_node("cwru_rviz_rostest")
    rostest.rosrun("cwru_baxter_sim", "cwru_picture", CwruRvizTest)
