#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The notes' commands in another order than they print them: client first, then server, then enable."""
import os
import signal
import subprocess
import time
import unittest

import numpy as np
import rospy

from baxter_traj_streamer.settings import SIDES
from baxter_traj_streamer.streamer import BaxterTrajStreamer

DEADLINE_S = 90.0
# The notes' goal, and the tolerance that is promised [rad].
PRE_POSE_RIGHT = [-0.907528, -0.111813, 2.06622, 1.8737, -1.295, 2.00164, -2.87179]
TOLERANCE = 0.01


class PrePoseInTheWorldTest(unittest.TestCase):
    def start(self, *command):
        process = subprocess.Popen(["rosrun", *command], start_new_session=True)
        self.addCleanup(self.stop, process)
        return process

    @staticmethod
    def stop(process):
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGINT)
            process.wait(timeout=20)

    def test_right_arm_then_left_arm(self):
        client = self.start("baxter_traj_streamer", "traj_action_client_pre_pose")
        self.start("baxter_traj_streamer", "traj_interpolator_as")
        subprocess.run(["rosrun", "baxter_tools", "enable_robot.py", "-e"], check=True, timeout=DEADLINE_S)
        self.assertEqual(client.wait(timeout=DEADLINE_S), 0)
        streamer = BaxterTrajStreamer()
        self.arrives(lambda: streamer.get_qvec_right_arm(), PRE_POSE_RIGHT)
        left = self.start("baxter_traj_streamer", "traj_action_client_pre_pose", SIDES[1], "--wait", "60")
        self.assertEqual(left.wait(timeout=DEADLINE_S), 0)
        self.arrives(lambda: streamer.get_qvec_left_arm(), streamer.settings.pose("pre_pose", "left"))
        # The right arm has been left to itself meanwhile, and holds.
        self.arrives(lambda: streamer.get_qvec_right_arm(), PRE_POSE_RIGHT)

    def arrives(self, measured, pose):
        end = time.monotonic() + DEADLINE_S
        while np.abs(np.subtract(measured(), pose)).max() > TOLERANCE:
            self.assertLess(time.monotonic(), end, "at %s, not at %s" % (measured(), pose))
            time.sleep(0.05)
        print("farthest joint is off by %.5f rad" % np.abs(np.subtract(measured(), pose)).max())


if __name__ == "__main__":
    import rostest

    rospy.init_node("traj_streamer_world_rostest")
    rostest.rosrun("baxter_traj_streamer", "traj_streamer_world", PrePoseInTheWorldTest)
