#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""A client like typical programs for the robot: the node first, then 2 s of ROS time for the first joint states.

It does not use the workspace's packages; prints the time at which joint states had arrived [s].
"""
import sys

import rospy
from sensor_msgs.msg import JointState

TIMEOUT_S = 2.0


def main():
    rospy.init_node("vendor_client")
    print("node at %.3f" % rospy.get_time(), flush=True)
    states = []
    rospy.Subscriber("robot/joint_states", JointState, states.append, queue_size=1)
    end_s = rospy.get_time() + TIMEOUT_S
    rate = rospy.Rate(100)
    while not states:
        if rospy.is_shutdown() or rospy.get_time() >= end_s:
            print("no joint states by %.3f" % rospy.get_time(), file=sys.stderr)
            return 1
        rate.sleep()
    print("joint states at %.3f" % rospy.get_time(), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
