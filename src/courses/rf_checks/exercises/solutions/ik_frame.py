#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Find out by an experiment which reference frame the IK service uses, and which frame it moves to the pose."""
import sys

import numpy as np
import rospy
import tf2_ros

import baxter_interface

POINT, ORIENTATION = (0.6, 0.3, 0.3), (0.0, 1.0, 0.0, 0.0)
REFERENCES = ("base", "torso", "head", "left_arm_mount")
TIPS = ("left_wrist", "left_hand", "left_gripper_base", "left_gripper", "left_gripper_camera")


def main():
    rospy.init_node("ik_frame_solution")
    baxter_interface.RobotEnable().enable()
    left = baxter_interface.Limb("left")
    buffer = tf2_ros.Buffer()
    listener = tf2_ros.TransformListener(buffer)  # noqa: F841  (fills the buffer as long as it lives)
    left.move_to_joint_positions(left.ik((POINT, ORIENTATION)))
    rospy.sleep(0.5)  # tf reports a little later than the joints

    def distance(reference, tip):
        """Distance of `tip`, measured in `reference`, from the requested point [m]."""
        try:
            found = buffer.lookup_transform(reference, tip, rospy.Time(0), rospy.Duration(1.0)).transform.translation
        except tf2_ros.TransformException:
            return np.inf
        return float(np.linalg.norm(np.subtract((found.x, found.y, found.z), POINT)))

    distances = {(reference, tip): distance(reference, tip) for reference in REFERENCES for tip in TIPS}
    reference, tip = min(distances, key=distances.__getitem__)
    print("%s in %s is %.1f mm from the point asked for" % (tip, reference, 1000.0 * distances[reference, tip]))
    print("reference frame: %s" % reference)
    print("commanded frame: %s" % tip)
    return 0


if __name__ == "__main__":
    sys.exit(main())
