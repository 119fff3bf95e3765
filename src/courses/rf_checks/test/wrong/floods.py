# SPDX-License-Identifier: BSD-3-Clause
# exercise: joint_command
"""A loop of commands without a pause."""
import rospy
from baxter_core_msgs.msg import JointCommand

import baxter_interface

rospy.init_node("student")
baxter_interface.RobotEnable().enable()
publisher = rospy.Publisher("/robot/limb/right/joint_command", JointCommand, queue_size=1)
command = JointCommand(mode=1, names=["right_s0"], command=[0.1])
while not rospy.is_shutdown():
    publisher.publish(command)
