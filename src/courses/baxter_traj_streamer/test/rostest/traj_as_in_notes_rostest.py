#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The server with the limitations of the notes, and one that stops goals whose sender has ended."""
import pathlib
import subprocess
import sys

import numpy as np
import rospy
from actionlib_msgs.msg import GoalStatus
from traj_rostest_kit import DEADLINE_S, Client, FakeRobotTest, wait_until

from baxter_traj_streamer.settings import arm_joint_names

ARM = arm_joint_names("right")
# Sends a goal that bends an elbow in 20 s, and stays.
SENDER = """
import rospy
from traj_rostest_kit import Client
rospy.init_node("sender", anonymous=True)
client = Client()
here = [float(number) for number in %r.split()]
there = [angle + 0.4 if i == 3 else angle for i, angle in enumerate(here)]
client.send([], [(0.0, here), (20.0, there)])
rospy.spin()
"""


class AsInNotesTest(FakeRobotTest):
    last_joints = ARM

    def way(self, by, duration_s):
        here = self.angles(ARM)
        return [(0.0, here), (duration_s, here + np.eye(7)[3] * by)]

    def test_no_feedback_no_preemption(self):
        moves = self.way(0.2, 1.0)
        start, top = moves[0][1], moves[1][1]
        self.client.send(ARM, moves)
        wait_until(lambda: len(self.commands) > 10, "the arm to be commanded")
        self.client.goal.cancel()
        newer = Client()
        newer.send(ARM, [(0.0, top + np.eye(7)[6] * 0.05), (0.5, start)])
        self.assertEqual(self.client.end()[0], GoalStatus.SUCCEEDED)

        def highest():
            """Of the first goal's commands; the newer one turns the wrist, too."""
            return max(message.command[3] for _, message in list(self.commands)
                       if abs(message.command[6] - start[6]) < 1e-6)

        # Results overtake commands.
        wait_until(lambda: abs(highest() - top[3]) < 0.005, "the end of the first way")
        self.assertEqual(newer.end()[0], GoalStatus.SUCCEEDED)
        self.assertLess(highest(), top[3] + 0.005)
        self.assertEqual(self.client.feedback, [])
        self.wait_until_at(ARM, start)

    def test_names_are_left_aside_and_limits_are_not_judged(self):
        here = self.angles(ARM)
        there = here + np.eye(7)[3] * 0.2
        self.client.send(list(reversed(ARM)), [(0.0, here), (0.5, there)])
        self.assertEqual(self.client.end()[0], GoalStatus.SUCCEEDED)
        self.wait_until_at(ARM, there)
        # 0.2 rad at 20 rad/s.
        self.client.send(ARM, [(0.0, here), (0.01, there)])
        self.assertEqual(self.client.end()[0], GoalStatus.SUCCEEDED)

    def test_goal_is_stopped_when_its_sender_is_gone(self):
        here = self.angles(ARM)
        sender = subprocess.Popen([sys.executable, "-c", SENDER % " ".join(map(str, here))],
                                  cwd=pathlib.Path(__file__).parent)
        try:
            wait_until(lambda: self.angles(ARM)[3] - here[3] > 0.02, "the arm to move")
        finally:
            sender.kill()
            sender.wait(timeout=DEADLINE_S)
        # The queue may have dropped the stream's last command.
        held = self.wait_until_held("right_e1")
        self.assertLess(held - here[3], 0.35)
        stream = np.array([value for _, value in self.raw_stream("right_e1")] + [held])
        self.assertLess(abs(stream[-1] - stream[-2]), 0.01)


if __name__ == "__main__":
    import rostest

    rospy.init_node("traj_as_in_notes_rostest")
    rostest.rosrun("baxter_traj_streamer", "traj_as_in_notes", AsInNotesTest)
