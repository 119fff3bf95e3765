#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Poses, playfiles and straight lines, each as command and as node."""
import pathlib
import subprocess
import tempfile

import numpy as np
import rospy
from baxter_traj_streamer.srv import CartMove, MoveToPose, PlayFile
from geometry_msgs.msg import Vector3
from traj_rostest_kit import DEADLINE_S, FakeRobotTest, wait_until

import urdf_model
from arm_kinematics import Chain
from baxter_traj_streamer.playfile import Playfile
from baxter_traj_streamer.settings import SIDES, arm_joint_names


def run(*command):
    done = subprocess.run(["rosrun", "baxter_traj_streamer", *map(str, command)], capture_output=True, text=True,
                          timeout=2 * DEADLINE_S, check=False)
    return done.returncode, done.stdout + done.stderr


class TrajMovesTest(FakeRobotTest):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        robot = urdf_model.parse_urdf(rospy.get_param("robot_description"), source="robot_description")
        cls.chains = {side: Chain.from_robot(robot, "base", "%s_gripper" % side) for side in SIDES}
        cls.services = {}
        for name, kind in (("move_to_pose", MoveToPose), ("play_file", PlayFile), ("cart_move", CartMove)):
            rospy.wait_for_service(name, timeout=DEADLINE_S)
            cls.services[name] = rospy.ServiceProxy(name, kind)
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.folder = pathlib.Path(folder.name)

    def call(self, service, **request):
        return self.services[service](**request)

    def roomy(self, side):
        return self.streamer.settings.pose("untucked", side)

    def go_where_there_is_room(self, side):
        answer = self.call("move_to_pose", side=side, pose="untucked", time_optimal=True)
        self.assertTrue(answer.success, answer.message)
        self.wait_until_at(arm_joint_names(side), self.roomy(side), within=0.001)

    def tip(self, side):
        return self.chains[side].fk(self.angles(arm_joint_names(side)))

    def wait_until_tip_has_moved(self, side, before, by):
        wait_until(lambda: np.abs(self.tip(side)[:3, 3] - before[:3, 3] - by).max() < 0.003,
                   lambda: "the tip to be %s from %s; it is at %s" % (by, before[:3, 3], self.tip(side)[:3, 3]))

    def playfile(self, side, by=0.2):
        """A file that bends an elbow there and back."""
        here = self.angles(arm_joint_names(side))
        rows = np.array([here, here + np.eye(7)[3] * by, here])
        path = self.folder / ("%s.jsp" % side)
        path.write_text(Playfile(rows, np.array([0.2, 0.8, 1.4]), "", ()).text(), encoding="utf-8")
        return path, here

    def test_named_pose_by_node_and_command(self):
        for side in SIDES:
            self.go_where_there_is_room(side)
        code, text = run("traj_action_client_pre_pose", "left", "--time-optimal", "--wait", "30")
        self.assertEqual(code, 0, text)
        self.assertIn("the arm is there", text)
        answer = self.call("move_to_pose", side="right", time_optimal=True,
                           angles=self.streamer.settings.pose("pre_pose", "right"))
        self.assertTrue(answer.success, answer.message)
        for side in SIDES:
            self.wait_until_at(arm_joint_names(side), self.streamer.settings.pose("pre_pose", side))
        for request, word in (({"side": "up", "pose": "pre_pose"}, "right and left"),
                              ({"side": "left", "pose": "post_pose"}, "pre_pose"),
                              ({"side": "left", "angles": [1.0]}, "7 finite numbers")):
            answer = self.call("move_to_pose", **request)
            self.assertFalse(answer.success)
            self.assertIn(word, answer.message)

    def test_playfiles_by_node_and_command(self):
        for side in SIDES:
            self.go_where_there_is_room(side)
        (right, _), (left, _) = self.playfile("right"), self.playfile("left")
        answer = self.call("play_file", right=str(right), left=str(left))
        self.assertTrue(answer.success, answer.message)
        for side in SIDES:
            self.wait_until_held("%s_e1" % side)
            way = [value for _, value in self.raw_stream("%s_e1" % side)]
            self.assertAlmostEqual(max(way), self.roomy(side)[3] + 0.2, delta=0.01)
            self.assertAlmostEqual(way[-1], self.roomy(side)[3], delta=0.01)
        self.forget_commands()
        code, text = run("baxter_playfile_jointspace", right, left, "--check")
        self.assertEqual(code, 0, text)
        self.assertIn("3 rows, 1.200 s for the right arm; can be played", text)
        self.assertEqual(self.commands, [])
        code, text = run("baxter_playfile_jointspace", "-", left, "--time-optimal")
        self.assertEqual(code, 0, text)
        self.assertAlmostEqual(max(value for _, value in self.raw_stream("left_e1")), self.roomy("left")[3] + 0.2,
                               delta=0.01)
        self.assertEqual(self.raw_stream("right_e1"), [])

    def test_bad_playfiles_move_nothing(self):
        far, _ = self.playfile("right", by=9.0)
        code, text = run("traj_action_client_pre_pose", "right", "--file", far)
        self.assertEqual(code, 1)
        self.assertIn("right.jsp, line 2", text)
        answer = self.call("play_file", left=str(self.folder / "none.jsp"))
        self.assertFalse(answer.success)
        self.assertIn("none.jsp", answer.message)
        self.assertFalse(self.call("play_file").success)
        self.assertEqual(self.commands, [])

    def test_recorded_move_can_be_played(self):
        self.go_where_there_is_room("right")
        path = self.folder / "recorded.jsp"
        code, text = run("baxter_record_trajectory", path, "right", "--seconds", "0.6", "--rate", "10")
        self.assertEqual(code, 0, text)
        file = Playfile.read(path)
        self.assertEqual(file.times.tolist(), [0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
        np.testing.assert_allclose(file.positions, [self.roomy("right")] * 6, atol=0.01)
        answer = self.call("play_file", right=str(path))
        self.assertTrue(answer.success, answer.message)

    def test_straight_line_by_node_and_command(self):
        for side in SIDES:
            self.go_where_there_is_room(side)
            before = self.tip(side)
            answer = self.call("cart_move", side=side, displacement=Vector3(0.06, 0.0, -0.04), speed=0.2)
            self.assertTrue(answer.success, answer.message)
            self.wait_until_tip_has_moved(side, before, [0.06, 0.0, -0.04])
            np.testing.assert_allclose(self.tip(side)[:3, :3], before[:3, :3], atol=0.01)
        there = self.tip("left")
        code, text = run("cart_move", "left", "-0.06", "0", "0.04", "--speed", "0.2")
        self.assertEqual(code, 0, text)
        self.wait_until_tip_has_moved("left", there, [-0.06, 0.0, 0.04])
        self.forget_commands()
        code, text = run("cart_move", "left", 2, 0, 0)
        self.assertEqual(code, 1)
        self.assertIn("leaves the arm's reach after 0.3", text)
        answer = self.call("cart_move", side="left", displacement=Vector3(0.1, 0.0, 0.0), speed=-1.0)
        self.assertFalse(answer.success)
        self.assertIn("speed", answer.message)
        self.assertEqual(self.commands, [])


if __name__ == "__main__":
    import rostest

    rospy.init_node("traj_moves_rostest")
    rostest.rosrun("baxter_traj_streamer", "traj_moves", TrajMovesTest)
