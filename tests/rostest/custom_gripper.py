#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The SDK's Gripper on a bare arm, and after a client has described its tool."""

import unittest

import rospy
import rostest
from baxter_core_msgs.msg import EndEffectorProperties, EndEffectorState

from baxter_dataflow import wait_for
from baxter_interface import Gripper
from baxter_interface.startup import init_node

DEADLINE_S = 20.0  # [simulated s]
TOPIC = "/robot/end_effector/%s_gripper/"


def announce(side):
    """Describe a custom tool of an arm, until the robot publishes it."""
    publisher = rospy.Publisher(TOPIC % side + "rsdk/set_properties", EndEffectorProperties, queue_size=1)
    seen = []
    subscriber = rospy.Subscriber(TOPIC % side + "properties", EndEffectorProperties, seen.append)
    tool = EndEffectorProperties(id=131073, ui_type=EndEffectorProperties.PASSIVE_GRIPPER, product="pen")
    wait_for(lambda: seen and seen[-1] == tool, DEADLINE_S, body=lambda: publisher.publish(tool))
    subscriber.unregister()
    publisher.unregister()


class CustomTest(unittest.TestCase):
    def test_a_bare_arm_carries_something_passive(self):
        """As on the physical robot, which does not know whether a tool is mounted."""
        gripper = Gripper("right")
        self.assertEqual((gripper.type(), gripper.hardware_id()), ("custom", 131073))
        self.assertFalse(gripper.ready() or gripper.calibrated() or gripper.gripping())
        self.assertIsNone(gripper.open())

    def test_custom_tool_is_what_the_client_says(self):
        announce("left")
        gripper = Gripper("left")
        self.assertEqual((gripper.type(), gripper.hardware_id(), gripper.hardware_name()), ("custom", 131073, "pen"))
        self.assertFalse(gripper.ready() or gripper.calibrated() or gripper.gripping())
        self.assertIsNone(gripper.open())
        state = EndEffectorState(id=131073, ready=1, gripping=1, position=30.0)
        publisher = rospy.Publisher(TOPIC % "left" + "rsdk/set_state", EndEffectorState, queue_size=1)
        wait_for(gripper.gripping, DEADLINE_S, body=lambda: publisher.publish(state))
        self.assertEqual((gripper.ready(), gripper.position()), (True, 30.0))
        self.assertIs(gripper.reset_custom_state(timeout=DEADLINE_S), True)
        self.assertFalse(gripper.gripping())
        self.assertIs(gripper.reset_custom_properties(timeout=DEADLINE_S), True)
        self.assertEqual((gripper.type(), gripper.hardware_name()), ("custom", ""))


if __name__ == "__main__":
    init_node("custom_gripper_rostest")
    rostest.rosrun("workspace_tests", "custom_gripper", "__main__")
