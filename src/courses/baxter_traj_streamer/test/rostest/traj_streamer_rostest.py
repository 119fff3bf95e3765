#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""trajActionServer and its clients against a fake robot."""
import math
import signal
import subprocess
import sys

import numpy as np
import rospy
from actionlib_msgs.msg import GoalStatus, GoalStatusArray
from baxter_core_msgs.msg import AssemblyState, JointCommand
from rosgraph_msgs.msg import Log
from traj_rostest_kit import DEADLINE_S, SERVER, Client, FakeRobotTest, wait_until

from baxter_traj_streamer.settings import arm_joint_names

# A client of the version without traj_id, as its packages would make it.
OTHER_VERSION = """
import genpy.dynamic, rospy, sys
kind = genpy.dynamic.generate_dynamic("cwru_action/trajActionGoal", sys.stdin.read())["cwru_action/trajActionGoal"]
rospy.init_node("other_version")
publisher = rospy.Publisher("/trajActionServer/goal", kind, queue_size=1, latch=True)
message = kind()
message.goal_id.id = "goal of the other version"
message.header.frame_id = "frame"
publisher.publish(message)
rospy.spin()
"""


class TrajStreamerTest(FakeRobotTest):
    def test_joints_of_both_arms_in_any_order(self):
        names = ["left_w1", "right_e1", "left_e0"]
        goal = self.move(names, [0.2, 0.3, 0.2], 2.0, traj_id=42)
        state, text, result = self.client.end()
        self.assertEqual(state, GoalStatus.SUCCEEDED, text)
        self.assertEqual(result.traj_id, 42)
        self.assertGreaterEqual(result.return_val, 1)
        self.wait_until_at(names, goal)
        self.assertEqual(self.client.feedback, sorted(self.client.feedback))
        self.assertGreaterEqual(len(self.client.feedback), 5)
        # Finally the goal itself, in POSITION mode.
        self.assertEqual(self.wait_until_held("right_e1"), goal[1])
        stream = self.raw_stream("right_e1")
        # A stream, not a jump, even if a busy machine skips steps.
        steps = np.diff([value for _, value in stream])
        self.assertGreater(len(steps), 10)
        # All in one direction.
        self.assertAlmostEqual(abs(steps.sum()), np.abs(steps).sum(), delta=1e-9)
        self.assertLess(np.abs(steps).max(), 0.15)

    def test_refused_goals_move_nothing_and_say_why(self):
        names = ["right_e1", "left_w1"]
        here = self.angles(names)
        before = self.angles(arm_joint_names("right") + arm_joint_names("left"))
        for points, words in (
                ([], ("no points",)),
                ([(1.0, [here[0], math.nan])], ("point 0", "left_w1", "nan")),
                ([(1.0, here), (0.5, here)], ("point 1", "0.5 s")),
                ([(9.0, [9.0, here[1]])], ("point 0", "right_e1", "9.0", "limit")),
                ([(0.0, here - 0.4), (5.0, here)], ("point 0", "start_tolerance")),
                ([(0.1, here - [0.4, 0.0])], ("point 0", "right_e1", "rad/s", "1.5"))):
            self.client.send(names, points)
            state, text, _ = self.client.end()
            self.assertEqual(state, GoalStatus.REJECTED, text)
            for word in words:
                self.assertIn(word, text)
        self.client.send(["right_e9", "left_w1"], [(1.0, here)])
        state, text, _ = self.client.end()
        self.assertEqual(state, GoalStatus.REJECTED)
        self.assertIn("right_e9", text)
        self.assertEqual(self.commands, [])
        after = self.angles(arm_joint_names("right") + arm_joint_names("left"))
        np.testing.assert_allclose(after, before, atol=0.001)

    def test_cancel_stops_smoothly(self):
        names = ["right_e1"]
        goal = self.move(names, [0.5], 4.0)
        self.client.wait_until_moving()
        self.client.goal.cancel()
        state, text, _ = self.client.end()
        self.assertEqual(state, GoalStatus.PREEMPTED, text)
        self.assertGreater(abs(goal[0] - self.angles(names)[0]), 0.02)
        # The queue may have dropped the stream's last command.
        held = self.wait_until_held("right_e1")
        stream = np.array([value for _, value in self.raw_stream("right_e1")] + [held])
        # The last steps get smaller, none is a jump.
        self.assertLess(np.abs(np.diff(stream)).max(), 0.15)
        self.assertLess(abs(stream[-1] - stream[-2]), 0.01)

    def test_newer_goal_takes_over_and_a_bad_one_does_not(self):
        names = ["left_e1"]
        self.move(names, [0.5], 20.0)
        self.client.wait_until_moving()
        bad = Client()
        bad.send(names, [(1.0, [math.nan])])
        self.assertEqual(bad.end()[0], GoalStatus.REJECTED)
        self.assertTrue(self.client.goal.is_active())
        newer = Client()
        newer.send(names, [(2.0, [0.6])])
        state, text, _ = newer.end()
        self.assertEqual(state, GoalStatus.SUCCEEDED, text)
        self.assertEqual(self.client.end()[0], GoalStatus.PREEMPTED)
        self.wait_until_at(names, [0.6])

    def test_disabled_robot_gets_no_commands(self):
        self.set_enabled(False)
        self.move(["right_w0"], [0.2], 1.0)
        state, text, _ = self.client.end()
        self.assertEqual(state, GoalStatus.REJECTED)
        self.assertIn("enable_robot.py -e", text)
        self.assertEqual(self.commands, [])

    def test_disabling_aborts(self):
        self.move(["right_w0"], [0.5], 10.0)
        self.client.wait_until_moving()
        self.set_enabled(False)
        state, text, _ = self.client.end()
        self.assertEqual(state, GoalStatus.ABORTED)
        self.assertIn("not enabled", text)

    def test_disabling_for_a_moment_aborts(self):
        state = rospy.Publisher("/robot/state", AssemblyState, queue_size=10)
        wait_until(lambda: any(connection.endpoint_id == SERVER for connection in state.impl.connections),
                   "the server to listen")
        self.move(["right_w0"], [0.5], 4.0)
        self.client.wait_until_moving()
        for enabled in (False, True):
            state.publish(AssemblyState(ready=True, enabled=enabled))
        state, text, _ = self.client.end()
        self.assertEqual(state, GoalStatus.ABORTED, text)
        # The server looks between the two messages or after them.
        self.assertRegex(text, "robot is not enabled|was disabled")

    def test_the_other_version_of_the_action_is_refused_with_a_line_that_says_which_to_use(self):
        from baxter_traj_streamer.msg import trajActionGoal
        text = trajActionGoal._full_text.replace("int32 traj_id\n", "").replace("baxter_traj_streamer/", "cwru_action/")
        log, states = [], {}
        subscribers = [
            rospy.Subscriber("/rosout", Log, lambda message: log.append(message.msg)),
            rospy.Subscriber("/trajActionServer/status", GoalStatusArray, lambda message: states.update(
                {goal.goal_id.id: (goal.status, goal.text) for goal in message.status_list}))]
        other = subprocess.Popen([sys.executable, "-c", OTHER_VERSION], stdin=subprocess.PIPE, text=True)
        try:
            other.stdin.write(text)
            other.stdin.close()
            wait_until(lambda: any("cwru_action/trajActionGoal" in line
                                   and "start the server with --action cwru_action/traj" in line for line in log),
                       "a line about the version")
            wait_until(lambda: "goal of the other version" in states, "the goal's state")
        finally:
            other.terminate()
            other.wait(timeout=DEADLINE_S)
            for subscriber in subscribers:
                subscriber.unregister()
        state, words = states["goal of the other version"]
        self.assertEqual(state, GoalStatus.REJECTED)
        self.assertIn("--action cwru_action/traj", words)
        self.assertEqual(self.commands, [])

    def test_goal_without_times_is_followed_as_fast_as_the_limits_allow(self):
        names = ["right_w0", "right_w1"]
        goal = self.inwards(names, [0.4, 0.2])
        self.client.send(names, [(0.0, self.angles(names)), (0.0, goal)])
        state, text, _ = self.client.end()
        self.assertEqual(state, GoalStatus.SUCCEEDED, text)
        self.wait_until_at(names, goal)
        self.wait_until_held("right_w0")
        stream = self.raw_stream("right_w0")
        self.assertGreater(len(stream), 10)

    def test_library_commands_a_pose(self):
        pose = self.streamer.get_qvec_left_arm()
        # Not w2: the server's last command to it may still be on its way to the robot, on a connection of its own.
        pose[5] = self.inwards(["left_w1"], [0.1])[0]
        self.streamer.cmd_pose_left(pose)
        wait_until(lambda: abs(self.streamer.get_qvec_left_arm()[5] - pose[5]) < 0.001, "w1 to follow")

    def test_arm_arrives_without_the_client(self):
        run = subprocess.run(["rosrun", "baxter_traj_streamer", "traj_action_client_pre_pose", "--wait", "0.5"],
                             capture_output=True, text=True, timeout=DEADLINE_S, check=False)
        self.assertEqual(run.returncode, 0, run.stderr)
        self.assertIn("the arm moves on", run.stdout + run.stderr)
        self.wait_until_at(arm_joint_names("right"), self.streamer.settings.pose("pre_pose", "right"))
        # The goal continues after its client, and must not continue after this test.
        wait_until(lambda: self.commands[-1][1].mode == JointCommand.POSITION_MODE, "the stream to end")

    def test_an_interrupted_client_says_so_and_what_the_arm_does(self):
        command = ["rosrun", "baxter_traj_streamer", "traj_action_client_pre_pose", "left", "--wait", "300"]
        client = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        self.addCleanup(client.kill)
        wait_until(lambda: self.raw_stream("left_s0"), "the arm to move")
        client.send_signal(signal.SIGINT)
        text = client.communicate(timeout=DEADLINE_S)[0]
        self.assertEqual(client.returncode, 130, text)
        self.assertIn("interrupted; the arm moves on", text)
        self.assertNotIn("no result within", text)
        self.wait_until_at(arm_joint_names("left"), self.streamer.settings.pose("pre_pose", "left"))
        wait_until(lambda: self.commands[-1][1].mode == JointCommand.POSITION_MODE, "the stream to end")


if __name__ == "__main__":
    import rostest

    rospy.init_node("traj_streamer_rostest")
    rostest.rosrun("baxter_traj_streamer", "traj_streamer", TrajStreamerTest)
