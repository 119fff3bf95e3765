# SPDX-License-Identifier: BSD-3-Clause
# exercise: wave
"""Stops the time."""
import time

import rospy
from std_srvs.srv import Empty

rospy.init_node("student")
rospy.ServiceProxy("/gazebo/pause_physics", Empty)()
time.sleep(100.0)
