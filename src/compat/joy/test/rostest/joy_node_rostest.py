#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""joy_node reads a named pipe in place of a joystick, waits for it, and survives its loss."""
import os
import queue
import struct
import subprocess
import tempfile
import unittest

import rospy
import rostest
from sensor_msgs.msg import Joy

BUTTON, AXIS, INITIAL = 1, 2, 0x80
LONGEST_S = 20.0


def event(kind, number, value):
    return struct.pack("=IhBB", 0, value, kind, number)


class JoyNodeTest(unittest.TestCase):
    """One node for each test."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.path = os.path.join(folder.name, "js0")
        self.messages = queue.Queue()
        subscriber = rospy.Subscriber("joy", Joy, self.messages.put, queue_size=100)
        self.addCleanup(subscriber.unregister)

    def start(self, *parameters):
        node = subprocess.Popen(["rosrun", "joy", "joy_node", "_dev:=" + self.path, *parameters],
                                stderr=subprocess.PIPE, text=True)
        self.addCleanup(node.stderr.close)
        self.addCleanup(node.wait)
        self.addCleanup(node.terminate)
        return node

    def plug_in(self):
        os.mkfifo(self.path)
        return os.open(self.path, os.O_WRONLY)  # waits for the node to read

    def receive(self):
        return self.messages.get(timeout=LONGEST_S)

    def test_events_become_messages_and_a_lost_joystick_is_released(self):
        self.start("_autorepeat_rate:=50", "_deadzone:=0.1")
        joystick = self.plug_in()
        os.write(joystick, b"".join(event(AXIS | INITIAL, number, 0) for number in range(2))
                 + event(BUTTON | INITIAL, 1, 0))
        message = self.receive()
        self.assertEqual((list(message.axes), list(message.buttons)), ([0.0, 0.0], [0, 0]))
        self.assertEqual(message.header.frame_id, self.path)
        os.write(joystick, event(AXIS, 1, -32767))
        while not message.axes[1]:
            message = self.receive()
        self.assertEqual((list(message.axes), list(message.buttons)), ([0.0, 1.0], [0, 0]))
        os.write(joystick, event(BUTTON, 1, 1))
        while not message.buttons[1]:
            message = self.receive()
        self.assertEqual((list(message.axes), list(message.buttons)), ([0.0, 1.0], [0, 1]))
        self.assertEqual(self.receive().buttons[1], 1, "repeated while nothing happens")
        os.remove(self.path)  # first, so that the node cannot open the old one again
        os.close(joystick)
        while message.buttons[1]:
            message = self.receive()
        self.assertEqual((list(message.axes), list(message.buttons)), ([0.0, 0.0], [0, 0]))
        joystick = self.plug_in()
        os.write(joystick, event(BUTTON, 0, 1))
        while not message.buttons[0]:
            message = self.receive()
        os.close(joystick)

    def test_a_parameter_out_of_range_ends_the_node_with_one_line(self):
        node = self.start("_deadzone:=2")
        self.assertEqual(node.wait(LONGEST_S), 2)
        self.assertIn("deadzone is 2.0; it must be from 0 to 0.9", node.stderr.read())


if __name__ == "__main__":
    rospy.init_node("joy_device")
    rostest.rosrun("joy", "joy_device", JoyNodeTest)
