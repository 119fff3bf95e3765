# SPDX-License-Identifier: BSD-3-Clause
# exercise: tf_listener
"""The sheet's listing, not yet adapted to the exercise: base and head, x y z w to quat2mat, for ever."""
import numpy as np
import rospy
import tf2_ros
from transforms3d import quaternions

rospy.init_node("student")
buffer = tf2_ros.Buffer()
listener = tf2_ros.TransformListener(buffer)
rate = rospy.Rate(1.0)
while not rospy.is_shutdown():
    try:
        found = buffer.lookup_transform("base", "head", rospy.Time()).transform
    except tf2_ros.TransformException:
        rate.sleep()
        continue
    q, t = found.rotation, found.translation
    rospy.loginfo("Translation:\n%s\nQuaternion:\n%s", t, q)
    rotation = quaternions.quat2mat((q.x, q.y, q.z, q.w))
    rospy.loginfo("Rotation matrix\n%s", rotation)
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, (t.x, t.y, t.z)
    rospy.loginfo("Homogenous matrix:\n%s", matrix)
    rospy.loginfo("New quaternion: %s", quaternions.mat2quat(rotation))
    rate.sleep()
