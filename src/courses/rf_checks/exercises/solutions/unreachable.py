#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Say why a pose of the left gripper has no solution: unreachable.py X Y Z QX QY QZ QW."""
import queue
import sys

import rospy
from baxter_core_msgs.srv import SolvePositionIK, SolvePositionIKRequest
from baxter_kinematics_msgs.msg import IKReport, IKVerdict
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from std_msgs.msg import Header

NODE = "/ExternalTools/left/PositionKinematicsNode/"
NAMES = {getattr(IKVerdict, name): name for name in ("SOLVED", "OUT_OF_REACH", "JOINT_LIMIT", "NOT_CONVERGED",
                                                     "SELF_COLLISION", "WORLD_COLLISION", "INVALID_REQUEST")}


def describe(verdict):
    """One line: the verdict's name and its reason."""
    name = NAMES[verdict.verdict]
    if verdict.verdict == IKVerdict.OUT_OF_REACH:
        return "%s: %.4f m and %.4f rad short" % (name, verdict.short_m, verdict.short_rad)
    if verdict.verdict == IKVerdict.JOINT_LIMIT:
        beyond = zip(verdict.joints, verdict.excess, strict=True)
        return "%s: %s" % (name, ", ".join("%s by %.3f rad" % pair for pair in beyond))
    return name


def main():
    numbers = [float(word) for word in rospy.myargv()[1:]]
    rospy.init_node("unreachable_solution", anonymous=True)
    reports = queue.Queue()
    rospy.Subscriber(NODE + "IKReport", IKReport, reports.put)
    service = rospy.ServiceProxy(NODE + "IKService", SolvePositionIK)
    service.wait_for_service(10.0)
    pose = PoseStamped(header=Header(frame_id="base"), pose=Pose(Point(*numbers[:3]), Quaternion(*numbers[3:])))
    service(SolvePositionIKRequest(pose_stamp=[pose]))
    while True:
        # The topic is latched: the first report may belong to an earlier request.
        for verdict in reports.get(timeout=10.0).verdicts:
            position = verdict.target.pose.position
            if [position.x, position.y, position.z] == numbers[:3]:
                print(describe(verdict))
                return 0


if __name__ == "__main__":
    sys.exit(main())
