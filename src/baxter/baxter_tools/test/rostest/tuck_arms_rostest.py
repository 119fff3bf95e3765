#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""tuck_arms.py folds and unfolds the simulated arms without a touch."""
import subprocess
import unittest
from unittest import mock

import numpy as np
import rospy
from sensor_msgs.msg import JointState

from baxter_interface import Limb, RobotEnable
from baxter_interface.joint_checks import limb_joint_names
from baxter_model import JOINTS, SIDES
from baxter_tools.self_clearance import SelfClearance

DEADLINE_S = 120.0
NAMES = [name for side in SIDES for name in limb_joint_names(side)]
# From shoulder to wrist [rad], left; where the other arm is the mirror image, MIRRORED joints turn the other way.
TUCKED = (-1.0, -2.07, 3.0, 2.55, 0.0, 0.01, 0.0)
UNTUCKED = (-0.08, -1.0, -1.19, 1.94, 0.67, 1.03, -0.5)
MIRRORED = ("s0", "e0", "w0", "w2")


class Trace:
    """Every posture of the arms that the robot reports."""

    def __init__(self):
        self.postures = []
        self._subscriber = rospy.Subscriber("/robot/joint_states", JointState, self._on_state, queue_size=1000)

    def _on_state(self, message):
        angles = dict(zip(message.name, message.position, strict=True))
        self.postures.append([angles[name] for name in NAMES])


class TuckArmsTest(unittest.TestCase):
    def tuck_arms(self, *options):
        return subprocess.run(["rosrun", "baxter_tools", "tuck_arms.py", *options], capture_output=True, text=True,
                              timeout=DEADLINE_S)

    def test_arms_fold_and_unfold_without_a_touch(self):
        clearance = SelfClearance(rospy.get_param("robot_description"), NAMES)
        self.addCleanup(clearance.close)
        robot = RobotEnable()
        for option, target in (("-t", TUCKED), ("-u", UNTUCKED)):
            trace = Trace()
            result = self.tuck_arms(option)
            self.assertEqual(result.returncode, 0, result.stdout + result.stderr)
            for side in SIDES:
                limb = Limb(side)
                for joint, angle in zip(JOINTS, target, strict=True):
                    sign = -1.0 if side == "right" and joint in MIRRORED else 1.0
                    self.assertAlmostEqual(limb.joint_angle("%s_%s" % (side, joint)), sign * angle, delta=0.01)
            self.assertGreater(len(trace.postures), 50)
            self.assertGreater(np.ptp(trace.postures, axis=0).max(), 1.0)
            self.assertGreater(min(map(clearance, trace.postures)), 0.002)
            self.assertFalse(robot.state().enabled)  # as before
            if option == "-t":
                self.look_at_a_move_of_folded_arms(robot)

    def look_at_a_move_of_folded_arms(self, robot):
        """The robot holds them; the program hears soon why, and what helps."""
        robot.enable()
        self.addCleanup(robot.disable)
        begin_s = rospy.get_time()
        with mock.patch.object(rospy, "logerr") as log:
            self.assertIs(Limb("left").move_to_neutral(), False)
        self.assertLess(rospy.get_time() - begin_s, 10.0)
        self.assertIn("too near to collision_head_link", str(log.mock_calls))
        self.assertIn("tuck_arms.py -u", str(log.mock_calls))
        robot.disable()

    def test_one_of_both_options_is_needed(self):
        for options in ((), ("-t", "-u")):
            self.assertEqual(self.tuck_arms(*options).returncode, 2)


if __name__ == "__main__":
    import rostest
    rospy.init_node("tuck_arms_rostest")
    rostest.rosrun("baxter_tools", "tuck_arms", "__main__")
