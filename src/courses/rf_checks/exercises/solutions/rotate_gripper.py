#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Bring the left gripper to the lab's pose, then turn it about its own axis: rotate_gripper.py AXIS DEGREES."""
import sys

import numpy as np
import rospy
import tf2_ros
from baxter_core_msgs.srv import SolvePositionIK, SolvePositionIKRequest
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from std_msgs.msg import Header
from transforms3d import axangles, quaternions

import baxter_interface

POINT = [0.644, 0.0, 0.066]
ORIENTATION = [-0.381, 0.923, -0.015, 0.052]  # x y z w
AXES = {"x": [1, 0, 0], "y": [0, 1, 0], "z": [0, 0, 1]}


def solve_ik(service, point, orientation):
    """Joint angles (dict) that put the gripper there; exits with a sentence when there are none."""
    header = Header(stamp=rospy.Time.now(), frame_id="base")
    pose = PoseStamped(header=header, pose=Pose(Point(*point), Quaternion(*orientation)))
    answer = service(SolvePositionIKRequest(pose_stamp=[pose]))
    if not answer.isValid[0]:
        sys.exit("no joint angles put the gripper at %s, %s" % (point, orientation))
    return dict(zip(answer.joints[0].name, answer.joints[0].position, strict=True))


def where_is(target, source):
    """Position and quaternion x y z w of `source` in `target`, from tf."""
    buffer = tf2_ros.Buffer()
    listener = tf2_ros.TransformListener(buffer)
    found = buffer.lookup_transform(target, source, rospy.Time(0), rospy.Duration(5.0)).transform
    listener.unregister()
    t, q = found.translation, found.rotation
    return [t.x, t.y, t.z], [q.x, q.y, q.z, q.w]


def rotated(orientation, axis, angle):
    """A quaternion x y z w turned about one of the moved frame's own axes."""
    x, y, z, w = orientation
    # The rotation is multiplied from the right: about the gripper's axis, not about that of base.
    turned = quaternions.quat2mat([w, x, y, z]) @ axangles.axangle2mat(AXES[axis], angle)
    w, x, y, z = quaternions.mat2quat(turned)
    return [x, y, z, w]


def main():
    axis, degrees = rospy.myargv()[1:]
    rospy.init_node("rotate_gripper_solution")
    baxter_interface.RobotEnable().enable()
    service = rospy.ServiceProxy("/ExternalTools/left/PositionKinematicsNode/IKService", SolvePositionIK)
    service.wait_for_service(10.0)
    left = baxter_interface.Limb("left")
    # The other arm out of the way first.
    baxter_interface.Limb("right").move_to_neutral()
    left.move_to_neutral()

    left.move_to_joint_positions(solve_ik(service, POINT, ORIENTATION))
    point, orientation = where_is("base", "left_gripper")
    orientation = rotated(orientation, axis, np.deg2rad(float(degrees)))
    print("turning to", orientation)
    left.move_to_joint_positions(solve_ik(service, point, orientation))
    return 0


if __name__ == "__main__":
    sys.exit(main())
