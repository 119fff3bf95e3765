#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Baxter's arms are steered by a gamepad and by keys; what is let go stops them."""
import os
import pty
import subprocess
import sys
import threading
import unittest

import rospy
import rostest
from geometry_msgs.msg import TwistStamped
from sensor_msgs.msg import Joy

from baxter_interface import Limb, RobotEnable
from baxter_model import SIDES
from lab_testing.waiting import stretched, wait_for_time, wait_until

RATE_HZ = 50.0
AT_REST = 0.01  # [rad/s]
#: Of the servo, and what the way of the messages takes in real time [s].
STOPS_IN_S = 0.1 + stretched(0.15)


class DevicesTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        RobotEnable().enable()
        cls.arms = {side: Limb(side) for side in SIDES}
        cls.listens = [rospy.Publisher("/%s_servo/delta_twist_cmds" % side, TwistStamped, queue_size=1)
                       for side in SIDES]
        wait_until(lambda: all(one.get_num_connections() for one in cls.listens), "both servos", 90.0)

    def height(self, side):
        return self.arms[side].endpoint_pose()["position"].z

    def raise_hand(self, side, send):
        """Call ``send()`` at RATE_HZ of simulated time until the hand is 5 cm higher."""
        begin = self.height(side)

        def is_higher():
            send()
            wait_for_time(1.0 / RATE_HZ)
            return self.height(side) > begin + 0.05
        wait_until(is_higher, "the %s hand 5 cm higher" % side, 30.0)

    def seconds_to_rest(self, side):
        begin = rospy.get_time()
        wait_until(lambda: rospy.get_time() > begin + 0.02 and max(
            map(abs, self.arms[side].joint_velocities().values())) < AT_REST, "the %s arm to rest" % side, 20.0)
        return rospy.get_time() - begin

    def test_a_gamepad(self):
        pad = rospy.Publisher("joy", Joy, queue_size=1)
        wait_until(pad.get_num_connections, "the gamepad's node", 20.0)
        axes = [0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0, 0.0]
        held = Joy(axes=axes, buttons=[0, 0, 0, 0, 0, 1, 0, 0])
        self.raise_hand("left", lambda: pad.publish(held))
        pad.publish(Joy(axes=axes, buttons=[0] * 8))
        self.assertLess(self.seconds_to_rest("left"), STOPS_IN_S)

    def test_keys(self):
        end, terminal = pty.openpty()
        keys = subprocess.Popen(["rosrun", "steering_devices", "servo_keyboard", "_servos:=left_servo right_servo"],
                                stdin=terminal, stdout=terminal, stderr=terminal, env={**os.environ, "TERM": "xterm"})
        os.close(terminal)
        screen = []
        threading.Thread(target=_read, args=(end, screen), daemon=True).start()
        try:
            wait_until(lambda: b"hand" in b"".join(screen), "the keys on screen", 30.0)
            os.write(end, b"h+++")
            self.raise_hand("right", lambda: os.write(end, b"r"))
            self.seconds_to_rest("right")
            os.write(end, b"x")
            self.assertEqual(keys.wait(timeout=30.0), 0)
        finally:
            if keys.poll() is None:
                keys.kill()
                keys.wait()
            os.close(end)


def _read(end, screen):
    try:
        while data := os.read(end, 4096):
            screen.append(data)
    except OSError:
        pass  # the terminal is closed


if __name__ == "__main__":
    rospy.init_node("devices")
    rostest.rosrun("workspace_tests", "devices", DevicesTest, sys.argv)
