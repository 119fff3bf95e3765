#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""`sysid` without a recording: who has not agreed sees no motion; the robot's switch and Ctrl-C end it."""
import signal
import subprocess
import unittest

import numpy as np
import rospy
from baxter_core_msgs.msg import JointCommand
from sensor_msgs.msg import JointState

from baxter_interface import RobotEnable
from baxter_model import joint_names
from lab_testing.waiting import stretched, wait_for_message, wait_for_time, wait_until

SIDE = "left"
LIMIT_S = 300.0


class LiveTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.switch = RobotEnable()
        cls.raw = 0
        rospy.Subscriber("robot/limb/%s/joint_command" % SIDE, JointCommand, cls.on_command)

    @classmethod
    def on_command(cls, message):
        cls.raw += message.mode == JointCommand.RAW_POSITION_MODE

    def setUp(self):
        self.switch.enable()
        type(self).raw = 0

    def start(self, *options, stdin=subprocess.DEVNULL):
        program = subprocess.Popen(["rosrun", "baxter_sysid", "sysid", "--arm", SIDE, "--seconds", "10", *options],
                                   stdin=stdin, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                                   start_new_session=True)
        self.addCleanup(program.kill)
        return program

    def ended(self, program):
        out, err = program.communicate(timeout=stretched(LIMIT_S))
        return program.returncode, out, err

    def require_still(self):
        def position():
            message = wait_for_message("robot/joint_states", JointState, lambda one: joint_names(SIDE)[0] in one.name)
            return np.array([message.position[message.name.index(name)] for name in joint_names(SIDE)])

        wait_for_time(0.5)
        before = position()
        wait_for_time(0.5)
        self.assertLess(np.abs(position() - before).max(), 2e-3)

    def test_nobody_agrees(self):
        status, out, err = self.ended(self.start())
        self.assertEqual(status, 2, err)
        self.assertIn(SIDE, out)
        self.assertIn("not moved", err)
        self.assertEqual(self.raw, 0)

    def test_a_disabled_robot_is_not_moved_and_one_that_is_disabled_stops(self):
        self.switch.disable()
        status, _, err = self.ended(self.start("--yes"))
        self.assertEqual((status, self.raw), (2, 0), err)
        self.assertIn("enable_robot.py -e", err)
        self.switch.enable()
        program = self.start("--yes")
        wait_until(lambda: self.raw > 50, "raw set-points", LIMIT_S)
        self.switch.disable()
        status, _, err = self.ended(program)
        self.assertEqual(status, 2)
        self.assertIn("not enabled", err)
        self.require_still()

    def test_ctrl_c_ends_it(self):
        program = self.start("--yes")
        wait_until(lambda: self.raw > 50, "raw set-points", LIMIT_S)
        program.send_signal(signal.SIGINT)
        self.assertEqual(self.ended(program)[0], 130)
        self.require_still()


if __name__ == "__main__":
    import rostest

    rospy.init_node("sysid_live_test")
    rostest.rosrun("baxter_sysid", "sysid_live", LiveTest)
