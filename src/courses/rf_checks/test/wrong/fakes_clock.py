# SPDX-License-Identifier: BSD-3-Clause
# exercise: joint_command
"""Publishes a time of its own."""
import rospy
from rosgraph_msgs.msg import Clock

rospy.init_node("student", disable_rostime=True)
rate = rospy.Rate(20)  # of wall time
publisher = rospy.Publisher("/clock", Clock, queue_size=1)
while not rospy.is_shutdown():
    publisher.publish(Clock(rospy.Time(1000000)))
    rate.sleep()
