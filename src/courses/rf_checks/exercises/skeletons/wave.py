#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
# exercise: wave
"""Wave with both arms at the same time: the grippers go to and fro along a sine path.

Three periods or more, 5 cm or more to either side, fast enough to be done in 40 s; then the program ends.
"""
import math
import sys

import rospy

import baxter_interface


def offset_at(time_s):
    """Offset of a gripper from its middle position at a time [m]."""
    # TODO: a sine of the time.
    return 0.0 * math.sin(time_s)


def main():
    rospy.init_node("my_wave")
    baxter_interface.RobotEnable().enable()
    limbs = [baxter_interface.Limb(side) for side in ("left", "right")]
    for limb in limbs:
        limb.move_to_neutral()
    # TODO: in a loop with a rospy.Rate: the middle of the wave plus offset_at(time), joint angles for it from the IK
    # service, and set_joint_positions for both arms.
    print("offset after a second:", offset_at(1.0))
    return 0


if __name__ == "__main__":
    sys.exit(main())
