# SPDX-License-Identifier: BSD-3-Clause
# exercise: joint_command
"""Puts the joints where they are to be, through the simulator."""
import sys

import rospy
from gazebo_msgs.srv import SetModelConfiguration

rospy.init_node("student")
names = ["right_s0", "right_s1", "right_e0", "right_e1", "right_w0", "right_w1", "right_w2"]
put = rospy.ServiceProxy("/gazebo/set_model_configuration", SetModelConfiguration)
put("baxter", "robot_description", names, [float(word) for word in sys.argv[1:]])
