# SPDX-License-Identifier: BSD-3-Clause
"""A lab with rviz on a virtual screen, for tests that look at its pictures."""
import os
import signal
import subprocess
import unittest
from pathlib import Path

import cv2
import numpy as np
import rospy
import tf2_ros

from lab_testing import virtual_screen
from lab_testing.waiting import stretched

TIMEOUT_S = stretched(90.0)
# Where rviz draws: right of the displays, below the tools.
VIEW = np.s_[66:766, 370:1180]


class RvizLab(unittest.TestCase):
    """launch: what roslaunch starts. The test itself starts it: the screen has to be there first."""

    launch = ()

    def setUp(self):
        self.screen = virtual_screen.open_for(self)
        self.lab = subprocess.Popen(["roslaunch", *self.launch], env=self.screen.environment, start_new_session=True)
        self.addCleanup(self.end_lab)
        self.tf = tf2_ros.Buffer()
        self.listener = tf2_ros.TransformListener(self.tf)

    def end_lab(self):
        if self.lab.poll() is None:
            os.killpg(self.lab.pid, signal.SIGINT)
            self.lab.wait(30.0)

    def position(self, frame, of):
        """Where the frame `of` is in `frame`, now (3,) [m]."""
        at = self.tf.lookup_transform(frame, of, rospy.Time(0), rospy.Duration(TIMEOUT_S)).transform.translation
        return np.array((at.x, at.y, at.z))

    def keep(self, name, picture=None):
        """Save a picture, the present one unless told, beside the test's other results."""
        folder = os.environ.get("ROS_TEST_RESULTS_DIR")
        if folder:
            picture = self.screen.picture() if picture is None else picture
            cv2.imwrite(str(Path(folder) / (name + ".png")), picture[:, :, ::-1])


def colours(picture):
    """Red, green, blue of rviz's view: integers, to subtract."""
    return (picture[VIEW][..., k].astype(int) for k in range(3))
