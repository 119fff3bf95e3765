#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""After an unforeseen error in the thread that follows the scene the servo minds it again; frames of tf alone."""
import subprocess
import sys
import threading
import unittest
from pathlib import Path

import rospy
import rostest
from control_msgs.msg import JointJog
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Pose, Quaternion, TransformStamped, TwistStamped
from moveit_msgs.msg import CollisionObject
from sensor_msgs.msg import JointState
from shape_msgs.msg import SolidPrimitive
from std_msgs.msg import Float64MultiArray, String
from tf2_msgs.msg import TFMessage

from lab_testing.waiting import wait_until

sys.path.insert(0, str(Path(__file__).parents[1]))
from steered_arms import PLANAR_SRDF, PLANAR_URDF  # noqa: E402

JOINTS = ["turn0", "turn1", "turn2"]
SETTINGS = {"move_group_name": "arm", "command_out_topic": "/out", "command_out_type": "std_msgs/Float64MultiArray"}


class FaultsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        rospy.set_param("robot_description", PLANAR_URDF)
        rospy.set_param("robot_description_semantic", PLANAR_SRDF)
        rospy.set_param("servo_server", SETTINGS)
        cls.angles, cls.reasons, cls.faults = [0.0, 0.4, 0.4], [], []
        cls.kept = [rospy.Subscriber("out", Float64MultiArray, cls.follow),
                    rospy.Subscriber("servo_server/status_reason", String, lambda said: cls.reasons.append(said.data)),
                    rospy.Subscriber("diagnostics", DiagnosticArray, lambda said: cls.faults.extend(
                        value.value for status in said.status for value in status.values))]
        cls.states = rospy.Publisher("joint_states", JointState, queue_size=1)
        cls.jogs = rospy.Publisher("servo_server/delta_joint_cmds", JointJog, queue_size=1)
        cls.twists = rospy.Publisher("servo_server/delta_twist_cmds", TwistStamped, queue_size=1)
        cls.objects = rospy.Publisher("collision_object", CollisionObject, queue_size=1)
        cls.tf = rospy.Publisher("tf_static", TFMessage, queue_size=1, latch=True)
        cls.node = subprocess.Popen([sys.executable, str(Path(__file__).with_name("faulty_servo.py")),
                                     "__name:=servo_server"])
        cls.ended = threading.Event()
        threading.Thread(target=cls.be_a_robot, daemon=True).start()
        wait_until(lambda: all(one.get_num_connections() for one in (cls.jogs, cls.twists, cls.objects)),
                   "the servo", 90.0)

    @classmethod
    def tearDownClass(cls):
        cls.ended.set()
        cls.node.terminate()
        cls.node.wait()

    @classmethod
    def follow(cls, message):
        cls.angles = list(message.data)

    @classmethod
    def be_a_robot(cls):
        while not cls.ended.wait(0.01):
            message = JointState(name=JOINTS, position=cls.angles, velocity=[0.0] * 3)
            message.header.stamp = rospy.Time.now()
            cls.states.publish(message)

    def steer(self, send, until, what):
        def done():
            send()
            return until()
        wait_until(done, what, 60.0, interval_s=0.02)

    def jog(self, velocity):
        self.jogs.publish(JointJog(joint_names=["turn0"], velocities=[velocity]))

    def test_1_the_scene_is_minded_after_an_error(self):
        self.steer(lambda: self.jog(-0.5), lambda: self.angles[0] < -0.2, "the arm to move")
        box = CollisionObject(id="crate", operation=CollisionObject.ADD)
        box.header.frame_id = "base"
        box.primitives = [SolidPrimitive(type=SolidPrimitive.BOX, dimensions=[0.2, 0.1, 0.4])]
        box.primitive_poses = [Pose(orientation=Quaternion(w=1.0))]
        box.primitive_poses[0].position.x, box.primitive_poses[0].position.y = 0.5, 0.6
        self.objects.publish(box)
        wait_until(lambda: any("nobody foresaw" in text for text in self.faults), "the error on /diagnostics", 30.0)
        self.steer(lambda: self.jog(0.5), lambda: any("crate" in text for text in self.reasons),
                   "the servo to stop before the crate")
        self.assertLess(self.angles[0], 1.2)
        self.steer(lambda: self.jog(-0.5), lambda: self.angles[0] < -0.2, "the way back")

    def test_2_frames_that_tf_alone_knows(self):
        frames = []
        for number in range(40):
            frame = TransformStamped(child_frame_id="camera%d" % number)
            frame.header.frame_id, frame.transform.rotation = "base", Quaternion(0.0, 0.0, 0.5**0.5, 0.5**0.5)
            frames.append(frame)
        self.tf.publish(TFMessage(frames))
        before, sent = self.angles[0], iter(range(10**6))

        def send():  # x of the camera is y of the base: the outstretched arm turns to the left
            message = TwistStamped()
            message.header.stamp, message.header.frame_id = rospy.Time.now(), "camera%d" % (next(sent) % 40)
            message.twist.linear.x = 0.1
            self.twists.publish(message)
        self.steer(send, lambda: self.angles[0] > before + 0.1, "the arm to turn to the left")


if __name__ == "__main__":
    rospy.init_node("servo_faults_rostest")
    rostest.rosrun("moveit_servo", "servo_faults", FaultsTest, sys.argv)
