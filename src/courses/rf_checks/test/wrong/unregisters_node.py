# SPDX-License-Identifier: BSD-3-Clause
# exercise: unreachable
"""Shuts the IK service's node down."""
import rosnode
import rospy

rospy.init_node("student", anonymous=True)
rosnode.kill_nodes(["/baxter_sim_kinematics_left"])
rospy.spin()
