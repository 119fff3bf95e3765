#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""joy_node reads a named pipe in place of a joystick, waits for it, and survives its loss."""
import queue
import subprocess
import unittest

import rospy
import rostest
from sensor_msgs.msg import Joy

from lab_testing.fake_joystick import FakeJoystick

LONGEST_S = 90.0


class JoyNodeTest(unittest.TestCase):
    """One node for each test."""

    def setUp(self):
        self.joystick = FakeJoystick(sticks=[0.0, 0.0], buttons=[0, 0])
        self.addCleanup(self.joystick.close)
        self.messages = queue.Queue()
        subscriber = rospy.Subscriber("joy", Joy, self.messages.put, queue_size=100)
        self.addCleanup(subscriber.unregister)

    def start(self, *parameters):
        node = subprocess.Popen(["rosrun", "joy", "joy_node", "_dev:=" + self.joystick.path, *parameters],
                                stderr=subprocess.PIPE, text=True)
        self.addCleanup(node.stderr.close)
        self.addCleanup(node.wait)
        self.addCleanup(node.terminate)
        return node

    def receive(self):
        """(axes, buttons) of the next message."""
        message = self.messages.get(timeout=LONGEST_S)
        self.assertEqual(message.header.frame_id, self.joystick.path)
        return [round(value, 3) for value in message.axes], list(message.buttons)

    def receive_until(self, axes, buttons):
        """Wait for this state."""
        while self.receive() != (axes, buttons):
            pass

    def test_events_become_messages_and_a_lost_joystick_is_released(self):
        self.start("_autorepeat_rate:=50", "_deadzone:=0.1")
        self.joystick.plug_in()
        self.receive_until([0.0, 0.0], [0, 0])
        self.joystick.push(1, 1.0)
        self.receive_until([0.0, 1.0], [0, 0])
        self.joystick.push(0, -0.55)
        self.receive_until([-0.5, 1.0], [0, 0])
        self.joystick.press(1)
        self.receive_until([-0.5, 1.0], [0, 1])
        self.assertEqual(self.receive(), ([-0.5, 1.0], [0, 1]), "again, while nothing happens")
        self.joystick.unplug()
        self.receive_until([0.0, 0.0], [0, 0])
        self.joystick.plug_in()
        self.joystick.press(0)
        self.receive_until([0.0, 0.0], [1, 0])

    def test_a_parameter_out_of_range_ends_the_node_with_one_line(self):
        node = self.start("_deadzone:=2")
        self.assertEqual(node.wait(LONGEST_S), 2)
        self.assertIn("deadzone is 2.0; it must be from 0 to 0.9", node.stderr.read())


if __name__ == "__main__":
    rospy.init_node("joy_device")
    rostest.rosrun("joy", "joy_device", JoyNodeTest)
