# SPDX-License-Identifier: BSD-3-Clause
# exercise: joint_command
"""Publishes a time of its own."""
import time

import rospy
from rosgraph_msgs.msg import Clock

rospy.init_node("student", disable_rostime=True)
publisher = rospy.Publisher("/clock", Clock, queue_size=1)
while not rospy.is_shutdown():
    publisher.publish(Clock(rospy.Time(1000000)))
    time.sleep(0.05)
