#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""trajActionServer when the simulator, and with it the clock, dies in the middle of a goal."""
import os
import signal
import xmlrpc.client

import rosgraph
import rospy
from actionlib_msgs.msg import GoalStatus
from traj_rostest_kit import FakeRobotTest


class LostRobotTest(FakeRobotTest):
    def test_the_goal_at_hand_and_the_next_one_end_and_say_why(self):
        self.move(["right_w0"], [0.5], 20.0)
        self.client.wait_until_moving()
        api = rosgraph.Master(rospy.get_name()).lookupNode("/fake_robot")
        os.kill(xmlrpc.client.ServerProxy(api).getPid(rospy.get_name())[2], signal.SIGKILL)
        self.assert_lost(GoalStatus.ABORTED)
        self.client.send(["right_w0"], [(1.0, [0.0])])
        self.assert_lost(GoalStatus.REJECTED)

    def assert_lost(self, expected):
        state, text, _ = self.client.end()
        self.assertEqual(state, expected, text)
        self.assertIn("the robot was lost: nobody publishes /robot/joint_states any more", text)


if __name__ == "__main__":
    import rostest

    rospy.init_node("traj_lost_robot_rostest")
    rostest.rosrun("baxter_traj_streamer", "traj_lost_robot", LostRobotTest)
