# SPDX-License-Identifier: BSD-3-Clause
# exercise: rotate_gripper
"""Shuts the simulator down, as `rosnode kill` does."""
import rosnode
import rospy

rospy.init_node("student")
rosnode.kill_nodes([name for name in rosnode.get_node_names() if name.endswith("gazebo")])
rospy.spin()
