# SPDX-License-Identifier: BSD-3-Clause
# exercise: joint_command
"""The joint names as Case Western's notes list them."""
import sys

import rospy
from baxter_core_msgs.msg import JointCommand

import baxter_interface

rospy.init_node("student")
baxter_interface.RobotEnable().enable()
publisher = rospy.Publisher("/robot/limb/right/joint_command", JointCommand, queue_size=1)
command = JointCommand(mode=1, command=[float(word) for word in sys.argv[1:]])
for name in ("right_s0", "right_e1", "right_e1", "right_w0", "right_w1", "right_w1"):
    command.names.append(name)
rate = rospy.Rate(100)
for _ in range(300):
    publisher.publish(command)
    rate.sleep()
