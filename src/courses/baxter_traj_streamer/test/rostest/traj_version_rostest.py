#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""trajActionServer as cwru_action/traj, and clients of either version."""
import subprocess
import sys

import rospy
from actionlib_msgs.msg import GoalStatus
from rosgraph_msgs.msg import Log
from traj_rostest_kit import DEADLINE_S, Client, FakeRobotTest, wait_until

from baxter_traj_streamer.versions import CURRENT
from lab_testing import waiting

# As a client of the notes' version: it waits for the server, which never comes.
NOTES_CLIENT = """
import actionlib, rospy
from baxter_traj_streamer.msg import trajAction
rospy.init_node("client_of_the_notes")
actionlib.SimpleActionClient("trajActionServer", trajAction).wait_for_server()
"""


class TrajVersionTest(FakeRobotTest):
    action = CURRENT

    def test_a_goal_without_an_id_is_followed(self):
        names = ["right_w0", "left_w1"]
        goal = self.move(names, [0.2, 0.2], 2.0)
        self.client.wait_until_moving()
        state, text, result = self.client.end()
        self.assertEqual(state, GoalStatus.SUCCEEDED, text)
        self.assertGreaterEqual(result.return_val, 1)
        self.wait_until_at(names, goal)

    def test_a_goal_without_an_id_is_refused_with_the_reason(self):
        client = Client(self.action)
        client.send(["no_such_joint"], [(1.0, [0.0])])
        state, text, _ = client.end()
        self.assertEqual(state, GoalStatus.REJECTED)
        self.assertIn("no_such_joint", text)

    def test_the_own_client_speaks_what_the_server_serves(self):
        said = subprocess.run(["rosrun", "baxter_traj_streamer", "traj_action_client_pre_pose"], check=False, text=True,
                              capture_output=True, timeout=waiting.stretched(60.0))
        self.assertEqual(said.returncode, 0, said.stderr)
        self.assertIn("the arm is there", said.stdout + said.stderr)

    def test_a_client_of_the_notes_is_told_of_on_the_servers_side_and_its_own(self):
        log = []
        subscriber = rospy.Subscriber("/rosout", Log, lambda message: log.append((message.name, message.msg)))
        other = subprocess.Popen([sys.executable, "-c", NOTES_CLIENT])
        try:
            wait_until(lambda: any("--action baxter_traj_streamer/traj" in text for _, text in log),
                       "the server's line")
            wait_until(lambda: any(name == "/client_of_the_notes" and "trajActionServer/result" in text
                                   for name, text in log), "the client's line")
        finally:
            other.terminate()
            other.wait(timeout=DEADLINE_S)
            subscriber.unregister()


if __name__ == "__main__":
    import rostest

    rospy.init_node("traj_version_rostest")
    rostest.rosrun("baxter_traj_streamer", "traj_version", TrajVersionTest)
