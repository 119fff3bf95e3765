#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The picture in the notes: rviz with the robot, and in front of it the points of the table and of the can."""
import os
import signal
import subprocess
import unittest
from pathlib import Path
from typing import NamedTuple

import numpy as np
import rospy

from lab_testing import virtual_screen
from lab_testing.waiting import wait_until

SCENE_COLUMNS = slice(380, 1150)  # right of the panels


class Seen(NamedTuple):
    """Pixel counts of the picture by content."""

    table: int
    can: int
    robot: int

    def is_full(self):
        return self.table > 5000 and self.can > 50 and self.robot > 2000


class CwruRvizTest(unittest.TestCase):
    def setUp(self):
        self.screen = virtual_screen.open_for(self)
        self.lab = subprocess.Popen(["roslaunch", "cwru_baxter_sim", "baxter_world.launch", "gui:=false", "rviz:=true"],
                                    env=self.screen.environment, start_new_session=True)
        self.addCleanup(self.end_lab)

    def end_lab(self):
        if self.lab.poll() is None:
            os.killpg(self.lab.pid, signal.SIGINT)
            self.lab.wait(20.0)

    def test_table_and_can_are_in_front_of_the_robot(self):
        try:
            wait_until(lambda: self.counts().is_full(), lambda: "a full picture; pixels of each: %s" % (self.counts(),),
                       timeout_s=200.0, interval_s=0.5)
        finally:
            self.keep(self.screen.picture())

    def counts(self):
        """Pixels by what they show."""
        red, green, blue = (self.screen.picture()[:, SCENE_COLUMNS, k].astype(int) for k in range(3))
        return Seen(table=np.count_nonzero((red > 120) & (abs(red - 1.45 * green) < 25) & (blue < 0.75 * green)),
                    can=np.count_nonzero((green > 2 * red) & (green > 1.5 * blue) & (green > 25)),
                    robot=np.count_nonzero((red > 100) & (green < 40) & (blue < 40)))

    def keep(self, picture):
        """Save the picture beside the test's other results."""
        folder = os.environ.get("ROS_TEST_RESULTS_DIR")
        if folder:
            height, width, _ = picture.shape
            (Path(folder) / "cwru_rviz.ppm").write_bytes(b"P6 %d %d 255\n" % (width, height) + picture.tobytes())


if __name__ == "__main__":
    import rostest
    rospy.init_node("cwru_rviz_rostest")
    rostest.rosrun("cwru_baxter_sim", "cwru_picture", CwruRvizTest)
