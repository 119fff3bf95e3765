#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The lab end to end with other arguments than the defaults."""
import unittest

import rospy
from robot_client import SIDES, Robot, joints

from lab_testing.waiting import wait_until

# The joints' sensors count in 0.0004 rad and are noisy by as much, and a motor at rest creeps to its set-point.
SEEN_RAD = 0.005
UNTUCKED = {"left": (-0.08, -1.0, -1.19, 1.94, 0.67, 1.03, -0.50), "right": (0.08, -1.0, 1.19, 1.94, -0.67, 1.03, 0.50)}


class BaxterWorldVariantTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.robot = Robot()

    def test_a_enabled_and_untucked_from_the_first_message(self):
        self.assertTrue(self.robot.state.enabled and self.robot.state.ready)
        message = self.robot.history[0]
        state = dict(zip(message.name, message.position, strict=True))
        for side in SIDES:
            for name, angle in zip(joints(side), UNTUCKED[side], strict=True):
                self.assertAlmostEqual(state[name], angle, delta=SEEN_RAD, msg=name)

    def test_b_joint_states_have_17_names_at_100_hz(self):
        robot = self.robot
        robot.wait_sim(1.0)
        messages = list(robot.history)
        self.assertEqual(messages[-1].name, sorted(
            ["head_nod", "head_pan", "torso_t0", *joints("left"), *joints("right")]))
        stamps = [message.header.stamp.to_sec() for message in messages][1:]
        for earlier, later in zip(stamps, stamps[1:], strict=False):
            self.assertAlmostEqual(later - earlier, 0.01, delta=1e-6)

    def test_c_position_mode_begins_at_the_robots_speed(self):
        robot = self.robot
        start = robot.now()
        robot.move({"left_w2": 1.0, "right_w2": -1.0})
        self.assertAlmostEqual(robot.fastest("left_w2", start), 0.3 * 4.0, delta=0.05)

    def test_d_disabled_arms_sink(self):
        robot = self.robot
        robot.set_enabled(False)
        before = robot.positions["left_s1"]
        wait_until(lambda: robot.positions["left_s1"] > before + 0.05, "the left shoulder sinks")
        robot.set_enabled(True)
        robot.wait_sim(0.5)
        held = robot.positions
        robot.wait_sim(1.0)
        self.assertLess(robot.error(held), SEEN_RAD)


if __name__ == "__main__":
    import rostest
    rospy.init_node("baxter_world_variant_rostest")
    rostest.rosrun("baxter_gazebo", "baxter_world_variant", BaxterWorldVariantTest)
