#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The lab end to end with other arguments than the defaults."""
import os
import signal
import unittest
import xmlrpc.client

import rosgraph
import rospy
import tf2_ros
from baxter_core_msgs.srv import SolvePositionIK, SolvePositionIKRequest
from gazebo_msgs.srv import GetWorldProperties
from geometry_msgs.msg import PoseStamped
from robot_client import SIDES, Robot, joints
from std_srvs.srv import Empty as EmptyService
from tf2_msgs.msg import TFMessage

from lab_testing.waiting import wait_until

# The joints' sensors count in 0.0004 rad and are noisy by as much, and a motor at rest creeps to its set-point.
SEEN_RAD = 0.005
# A state that was sent before the pause, in this profile up to so long ago, is not followed by a newer one [s].
SENT_S = 0.05
UNTUCKED = {"left": (-0.08, -1.0, -1.19, 1.94, 0.67, 1.03, -0.50), "right": (0.08, -1.0, 1.19, 1.94, -0.67, 1.03, 0.50)}


class BaxterWorldVariantTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.robot = Robot()

    def test_a_enabled_and_untucked_from_the_first_message(self):
        self.assertTrue(self.robot.state.enabled and self.robot.state.ready)
        message = self.robot.history[0]
        state = dict(zip(message.name, message.position, strict=True))
        for side in SIDES:
            for name, angle in zip(joints(side), UNTUCKED[side], strict=True):
                self.assertAlmostEqual(state[name], angle, delta=SEEN_RAD, msg=name)

    def test_b_joint_states_have_17_names_at_100_hz(self):
        robot = self.robot
        robot.wait_sim(1.0)
        messages = list(robot.history)
        self.assertEqual(messages[-1].name, sorted(
            ["head_nod", "head_pan", "torso_t0", *joints("left"), *joints("right")]))
        stamps = [message.header.stamp.to_sec() for message in messages][1:]
        for earlier, later in zip(stamps, stamps[1:], strict=False):
            self.assertAlmostEqual(later - earlier, 0.01, delta=1e-6)

    def test_b_tf_has_every_joint_at_50_hz(self):
        stamps = {}

        def note(message):
            if message._connection_header["callerid"] == "/robot_state_publisher":
                for one in message.transforms:
                    stamps.setdefault(one.child_frame_id, []).append(one.header.stamp.to_nsec())

        subscriber = rospy.Subscriber("/tf", TFMessage, note)
        wait_until(lambda: len(stamps.get("left_upper_shoulder", ())) > 50, "tf")
        # What the node missed while it had no processor must not be missing in tf.
        api = rosgraph.Master(rospy.get_name()).lookupNode("/robot_state_publisher")
        pid = xmlrpc.client.ServerProxy(api).getPid(rospy.get_name())[2]
        os.kill(pid, signal.SIGSTOP)
        try:
            missed = len(self.robot.history) + 5
            wait_until(lambda: len(self.robot.history) >= missed, "joint states")
        finally:
            os.kill(pid, signal.SIGCONT)
        seen = len(stamps["left_upper_shoulder"])
        wait_until(lambda: len(stamps["left_upper_shoulder"]) > seen + 20, "tf after the stop")
        subscriber.unregister()
        self.assertEqual(len(stamps), 2 * 7 + 1)
        for of_one in stamps.values():
            self.assertEqual({b - a for a, b in zip(of_one, of_one[1:], strict=False)}, {20_000_000})
        buffer = tf2_ros.Buffer()
        listener = tf2_ros.TransformListener(buffer)
        for frame in ("left_gripper", "right_hand_camera", "head_camera", "reference/left_gripper"):
            wait_until(lambda frame=frame: buffer.can_transform("world", frame, rospy.Time()), "tf of " + frame)
        listener.unregister()

    def test_b_a_paused_lab_tells_a_newcomer_its_state(self):
        """Also where nobody has asked for joint states for a while."""
        def first_frame():
            stamps = []
            subscriber = rospy.Subscriber("/tf", TFMessage, lambda message: stamps.extend(
                one.header.stamp for one in message.transforms if one.child_frame_id == "left_upper_shoulder"))
            try:
                wait_until(lambda: stamps, "tf")
            finally:
                subscriber.unregister()
            return stamps[0]

        def resting():
            subscribers = dict(rosgraph.Master(rospy.get_name()).getSystemState()[1])["/robot/joint_states"]
            return subscribers == [rospy.get_name()]

        pause, go_on = (rospy.ServiceProxy("/gazebo/%s_physics" % word, EmptyService) for word in ("pause", "unpause"))
        wait_until(resting, "the lab's nodes to rest")
        pause()
        try:
            now_s = rospy.ServiceProxy("/gazebo/get_world_properties", GetWorldProperties)().sim_time
            frames = [first_frame() for _ in range(2)]
            asked = rospy.ServiceProxy("/ExternalTools/left/PositionKinematicsNode/IKService", SolvePositionIK)
            pose = PoseStamped()
            pose.header.frame_id, pose.pose.orientation.y = "base", 1.0
            pose.pose.position.x, pose.pose.position.y, pose.pose.position.z = 0.6, 0.3, 0.1
            answer = asked(SolvePositionIKRequest(pose_stamp=[pose]))
        finally:
            go_on()
        for stamp in (*frames, answer.joints[0].header.stamp):
            self.assertAlmostEqual(stamp.to_sec(), now_s, delta=SENT_S)
        wait_until(resting, "the lab's nodes to rest again")

    def test_c_position_mode_begins_at_the_robots_speed(self):
        robot = self.robot
        start = robot.now()
        robot.move({"left_w2": 1.0, "right_w2": -1.0})
        self.assertAlmostEqual(robot.fastest("left_w2", start), 0.3 * 4.0, delta=0.05)

    def test_d_disabled_arms_sink(self):
        robot = self.robot
        robot.set_enabled(False)
        before = robot.positions["left_s1"]
        wait_until(lambda: robot.positions["left_s1"] > before + 0.05, "the left shoulder sinks")
        robot.set_enabled(True)
        robot.wait_sim(0.5)
        held = robot.positions
        robot.wait_sim(1.0)
        self.assertLess(robot.error(held), SEEN_RAD)


if __name__ == "__main__":
    import rostest
    rospy.init_node("baxter_world_variant_rostest")
    rostest.rosrun("baxter_gazebo", "baxter_world_variant", BaxterWorldVariantTest)
