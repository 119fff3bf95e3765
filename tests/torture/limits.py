# SPDX-License-Identifier: BSD-3-Clause
"""Joint limits, from the description that the lab was launched with."""
from xml.etree import ElementTree

import rospy


def arm_limits():
    """{joint: (lower, upper)} [rad] of all joints with limits in robot_description."""
    found = {}
    for joint in ElementTree.fromstring(rospy.get_param("/robot_description")).iter("joint"):
        limit = joint.find("limit")
        if joint.get("type") in ("revolute", "prismatic") and limit is not None:
            found[joint.get("name")] = (float(limit.get("lower", 0.0)), float(limit.get("upper", 0.0)))
    return found
