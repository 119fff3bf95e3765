#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The launch file, started a second time on the same master, and with invalid arguments."""
import subprocess
import unittest
import xmlrpc.client

import rosgraph
import rospy
from robot_client import Latest, Robot
from tf2_msgs.msg import TFMessage

from lab_testing.waiting import wait_until

HELPERS = ("/base_to_world", "/robot_state_publisher", "/baxter_sim_kinematics_left", "/baxter_sim_kinematics_right")
LAUNCH = ["roslaunch", "baxter_gazebo", "baxter_world.launch", "gui:=false"]


def process_of(node):
    """Process id of a node that answers, or None."""
    try:
        uri = rosgraph.Master(rospy.get_name()).lookupNode(node)
        return xmlrpc.client.ServerProxy(uri).getPid(rospy.get_name())[2]
    except (OSError, rosgraph.MasterError):
        return None


def launch(*arguments):
    """Exit code and output of a launch that ends by itself."""
    done = subprocess.run([*LAUNCH, *arguments], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT, text=True, errors="replace", timeout=60.0)
    return done.returncode, done.stdout


class SecondLabTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.robot = Robot()

    def test_a_the_first_lab_is_whole_again_after_a_second_launch(self):
        for node in HELPERS:
            wait_until(lambda node=node: process_of(node), node)
        simulator = process_of("/gazebo")
        _, output = launch()
        self.assertIn("A simulator is running on this ROS master", output)
        self.assertEqual(process_of("/gazebo"), simulator)
        # The nodes of the second launch have the same names and so shut the first launch's nodes down; roslaunch
        # restarts them.
        for node in HELPERS:
            wait_until(lambda node=node: process_of(node), node + " is back")
        for topic in ("/tf", "/tf_static"):
            latest = Latest(topic, TFMessage)
            wait_until(lambda latest=latest: latest.message, topic)

    def test_b_a_gripper_argument_that_is_neither_true_nor_false_is_named(self):
        for side in ("left", "right"):
            code, output = launch("%s_electric_gripper:=no" % side)
            self.assertNotEqual(code, 0)
            self.assertIn("%s_gripper:=no is none of electric, suction, none" % side, output)


if __name__ == "__main__":
    import rostest
    rospy.init_node("second_lab_rostest")
    rostest.rosrun("baxter_gazebo", "second_lab", SecondLabTest)
