#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Both of Baxter's arms are steered over the interface."""
import math
import sys
import unittest

import numpy as np
import rospy
import rostest
from baxter_core_msgs.msg import EndpointState
from control_msgs.msg import JointJog
from geometry_msgs.msg import Pose, PoseStamped, TwistStamped
from moveit_msgs.msg import CollisionObject
from moveit_msgs.srv import ChangeControlDimensions, ChangeDriftDimensions
from sensor_msgs.msg import JointState
from shape_msgs.msg import SolidPrimitive
from std_msgs.msg import Int8, String
from std_srvs.srv import Empty

from baxter_interface import Limb, RobotEnable
from lab_testing.waiting import stretched, wait_for_time, wait_until

SIDES = ("left", "right")
RATE_HZ = 50.0
AT_REST = 0.01  # [rad/s]


class Arm:
    """The state of one arm, and its servo's topics."""

    def __init__(self, side):
        self.side, self.position, self.speed, self.time = side, None, 0.0, 0.0
        self.statuses, self.reasons, self.pose = [], [], None
        servo = "/%s_servo/" % side
        self.twists = rospy.Publisher(servo + "delta_twist_cmds", TwistStamped, queue_size=1)
        self.jogs = rospy.Publisher(servo + "delta_joint_cmds", JointJog, queue_size=1)
        self.poses = rospy.Publisher(servo + "target_pose", PoseStamped, queue_size=1)
        self.kept = [
            rospy.Subscriber("/robot/limb/%s/endpoint_state" % side, EndpointState, self._on_endpoint),
            rospy.Subscriber("/robot/joint_states", JointState, self._on_joints),
            rospy.Subscriber(servo + "status", Int8, lambda message: self.statuses.append(message.data)),
            rospy.Subscriber(servo + "status_reason", String, lambda message: self.reasons.append(message.data))]
        wait_until(lambda: self.twists.get_num_connections() and self.position is not None, "the %s servo" % side, 90.0)

    def _on_endpoint(self, message):
        self.pose = message.pose
        self.position = np.array([message.pose.position.x, message.pose.position.y, message.pose.position.z])

    def _on_joints(self, message):
        own = [abs(speed) for name, speed in zip(message.name, message.velocity, strict=False)
               if name.startswith(self.side + "_")]
        if own:
            self.speed, self.time = max(own), message.header.stamp.to_sec()

    def is_at_rest(self):
        return self.speed < AT_REST

    def wait_for_rest(self):
        """Wait until the arm rests; return for how long it moved on in simulated time."""
        begin = rospy.get_time()
        wait_until(lambda: self.time > begin + 0.02 and self.is_at_rest(), "the %s arm to rest" % self.side, 20.0)
        return self.time - begin


def twist(frame="", **parts):
    message = TwistStamped()
    message.header.stamp, message.header.frame_id = rospy.Time.now(), frame
    for name, value in parts.items():
        setattr(message.twist.linear, name, value)
    return message


class ServoTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        RobotEnable().enable()
        cls.arms = {side: Arm(side) for side in SIDES}

    def stream(self, send, until, what):
        """Call ``send()`` at RATE_HZ of simulated time until ``until()``; then nothing more is sent."""
        def ready():
            send()
            wait_for_time(1.0 / RATE_HZ)
            return until()
        wait_until(ready, what, 30.0)

    def test_1_the_hand_moves_as_told_and_stops(self):
        for arm in self.arms.values():
            before = arm.position
            self.stream(lambda arm=arm: arm.twists.publish(twist(z=0.15)), lambda arm=arm, before=before:
                        arm.position[2] > before[2] + 0.08, "the %s hand 8 cm higher" % arm.side)
            # The stream has ended: time-out, braking, and what the busy machine adds.
            self.assertLess(arm.wait_for_rest(), 0.1 + 0.1 + stretched(0.15))
            self.assertLess(np.abs(arm.position - before)[:2].max(), 0.02)

    def test_2_joints_poses_and_the_tools_axes(self):
        arm = self.arms["left"]
        begin = arm.position
        jog = JointJog(joint_names=["left_w2", "right_w2"], velocities=[0.5, 0.5])
        self.stream(lambda: arm.jogs.publish(jog), lambda: arm.speed > 0.3, "joint left_w2 to move")
        arm.wait_for_rest()
        self.assertTrue(self.arms["right"].is_at_rest())
        target = PoseStamped(pose=Pose(orientation=arm.pose.orientation))
        target.header.frame_id = "base"
        goal = begin + (0.0, 0.08, -0.05)
        target.pose.position.x, target.pose.position.y, target.pose.position.z = goal
        self.stream(lambda: arm.poses.publish(target), lambda: np.linalg.norm(arm.position - goal) < 0.01, "the pose")
        arm.wait_for_rest()
        before = arm.position
        self.stream(lambda: arm.twists.publish(twist("left_gripper", z=-0.1)), lambda: np.linalg.norm(
            arm.position - before) > 0.05, "5 cm along the tool's axis")
        arm.wait_for_rest()

    def test_3_bad_commands_are_ignored(self):
        arm = self.arms["right"]
        arm.wait_for_rest()
        before = arm.position
        for bad in (twist(x=math.nan), twist(x=math.inf), twist("nowhere", x=0.1)):
            arm.twists.publish(bad)
        arm.jogs.publish(JointJog(joint_names=["right_s0", "right_s1"], velocities=[1.0]))
        seen = len(arm.statuses)
        wait_until(lambda: len(arm.statuses) > seen + 30, "the servo to go on", 20.0)
        self.assertLess(np.abs(arm.position - before).max(), 0.005)

    def test_4_services(self):
        arm = self.arms["right"]
        control = rospy.ServiceProxy("/right_servo/change_control_dimensions", ChangeControlDimensions)
        self.assertTrue(control(False, True, True, True, True, True).success)
        before = arm.position
        self.stream(lambda: arm.twists.publish(twist(x=0.2, y=-0.1)), lambda: arm.position[1] < before[1] - 0.04,
                    "the hand 4 cm to the right")
        arm.wait_for_rest()
        self.assertLess(abs(arm.position[0] - before[0]), 0.02)
        self.assertTrue(control(*[True] * 6).success)
        drift = rospy.ServiceProxy("/right_servo/change_drift_dimensions", ChangeDriftDimensions)
        self.assertTrue(drift(**{"drift_%s_rotation" % axis: True for axis in "xyz"}).success)
        self.assertTrue(drift().success)
        rospy.ServiceProxy("/right_servo/reset_servo_status", Empty)()

    def test_5_an_object_of_the_scene_is_not_touched(self):
        arm = self.arms["left"]
        Limb("left").move_to_neutral()  # the hand points downwards, and nothing of the arm is below
        arm.wait_for_rest()
        where = arm.position
        box = CollisionObject(id="shelf", operation=CollisionObject.ADD)
        box.header.frame_id = "base"
        box.primitives = [SolidPrimitive(type=SolidPrimitive.BOX, dimensions=[0.4, 0.4, 0.1])]
        box.primitive_poses = [Pose()]
        box.primitive_poses[0].position.x, box.primitive_poses[0].position.y = where[:2]
        box.primitive_poses[0].position.z = where[2] - 0.25
        box.primitive_poses[0].orientation.w = 1.0
        objects = rospy.Publisher("collision_object", CollisionObject, queue_size=1, latch=True)
        objects.publish(box)
        wait_until(lambda: objects.get_num_connections() >= 2, "both servos to hear of the shelf", 20.0)
        arm.statuses.clear()
        arm.reasons.clear()
        self.stream(lambda: arm.twists.publish(twist(z=-0.2)), lambda: any("shelf" in text for text in arm.reasons),
                    "the servo to name the shelf")
        self.assertTrue({3, 4} & set(arm.statuses))
        self.stream(lambda: arm.twists.publish(twist(z=0.2)), lambda: arm.position[2] > where[2], "the way back")
        objects.publish(CollisionObject(id="shelf", operation=CollisionObject.REMOVE, header=box.header))
        arm.wait_for_rest()


if __name__ == "__main__":
    rospy.init_node("servo_rostest")
    rostest.rosrun("moveit_servo", "servo", ServoTest, sys.argv)
