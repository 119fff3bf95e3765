# SPDX-License-Identifier: BSD-3-Clause
# exercise: tf_listener
"""The sheet's own slip: x y z w to quat2mat."""
import numpy as np
import rospy
import tf2_ros
from transforms3d import quaternions

rospy.init_node("student")
buffer = tf2_ros.Buffer()
listener = tf2_ros.TransformListener(buffer)
for pair in (("base", "left_hand"), ("left_hand", "right_hand"), ("head_camera", "left_gripper_base")):
    found = buffer.lookup_transform(*pair, rospy.Time(), rospy.Duration(5.0)).transform
    q, t = found.rotation, found.translation
    matrix = np.eye(4)
    matrix[:3, :3] = quaternions.quat2mat((q.x, q.y, q.z, q.w))
    matrix[:3, 3] = [t.x, t.y, t.z]
    rospy.loginfo("Homogenous matrix: \n" + str(matrix))
