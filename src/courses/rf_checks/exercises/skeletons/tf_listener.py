#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
# exercise: tf_listener
"""Print where one frame is in another, as a 4 by 4 matrix.

    tf_listener.py                   base -> left_hand, left_hand -> right_hand, head_camera -> left_gripper_base
    tf_listener.py TARGET SOURCE     this pair: the pose of SOURCE in TARGET

The last matrices that are printed count, one for each pair.
"""
import sys

import numpy as np
import rospy
import tf2_ros


def matrix(transform):
    """The 4 by 4 matrix of a geometry_msgs/Transform."""
    result = np.eye(4)
    # TODO: fill in the rotation (transforms3d.quaternions.quat2mat) and the translation.
    # Mind the order of a quaternion's numbers on both sides.
    return result


def main():
    words = rospy.myargv()[1:]
    # TODO: the pair on the command line, or the three pairs above.
    pairs = [("base", "head")]
    rospy.init_node("my_tf_listener", anonymous=True)
    buffer = tf2_ros.Buffer()
    listener = tf2_ros.TransformListener(buffer)  # noqa: F841  (fills the buffer as long as it lives)
    rospy.sleep(0.1)  # now is 0 until the first /clock comes, and a time-out that began at 0 would be over by then
    for target, source in pairs:
        found = buffer.lookup_transform(target, source, rospy.Time(0), rospy.Duration(5.0))
        print("%s -> %s %s\n%s" % (target, source, words, matrix(found.transform)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
