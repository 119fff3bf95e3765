#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Print where one frame is in another, as a 4 by 4 matrix: for two frames given, or for the sheet's three pairs."""
import sys

import numpy as np
import rospy
import tf2_ros
from transforms3d import quaternions

PAIRS = [("base", "left_hand"), ("left_hand", "right_hand"), ("head_camera", "left_gripper_base")]


def matrix(transform):
    """The 4 by 4 matrix of a geometry_msgs/Transform."""
    q, t = transform.rotation, transform.translation
    result = np.eye(4)
    result[:3, :3] = quaternions.quat2mat([q.w, q.x, q.y, q.z])  # transforms3d has w first, tf has it last
    result[:3, 3] = [t.x, t.y, t.z]
    return result


def main():
    words = rospy.myargv()[1:]
    pairs = [tuple(words)] if len(words) == 2 else PAIRS
    rospy.init_node("tf_listener_solution", anonymous=True)
    buffer = tf2_ros.Buffer()
    listener = tf2_ros.TransformListener(buffer)  # noqa: F841  (fills the buffer as long as it lives)
    np.set_printoptions(precision=6, suppress=True)
    rospy.sleep(0.1)  # now is 0 until the first /clock comes, and a time-out that began at 0 would be over by then
    for target, source in pairs:
        found = buffer.lookup_transform(target, source, rospy.Time(0), rospy.Duration(5.0))
        print("%s -> %s\n%s" % (target, source, matrix(found.transform)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
