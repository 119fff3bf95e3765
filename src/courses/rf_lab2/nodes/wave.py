#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Wave with both arms of Baxter, along a sine."""
import argparse
import sys
from concurrent.futures import ThreadPoolExecutor

import rospy

from baxter_interface import CHECK_VERSION, Limb, RobotEnable
from baxter_model import SIDES
from command_line.options import number
from rf_lab2.programs import LabProgramFailed, run
from rf_lab2.waving import Swing, hands_up, shifts

POINTS = 24
RATE_HZ = 50


def parse_arguments(argv):
    parser = argparse.ArgumentParser(prog="wave.py", description=__doc__,
                                     epilog="Exit status: 0 waved, 1 could not, 2 wrong options.")
    parser.add_argument("--seconds", type=number(float, 0, 3600, above=True), default=8.0,
                        help="how long (default: %(default)s)")
    parser.add_argument("--period", type=number(float, 1, 3600), default=2.0,
                        help="for once to and fro [s] (default: %(default)s)")
    parser.add_argument("--amplitude", type=number(float, -2, 2), default=0.12,
                        help="how far to each side [m] (default: %(default)s)")
    return parser.parse_args(argv)


def plan(limb, arguments):
    """The Swing of one arm, and its joints' names; solved point by point, each near the one before."""
    side, seed, rows = limb.name, hands_up(limb.name), []
    here = limb.endpoint_pose()
    for shift in shifts(side, arguments.amplitude, POINTS):
        point = [value + more for value, more in zip(here["position"], shift, strict=True)]
        seed = limb.ik((point, list(here["orientation"])), seed=seed)
        rows.append([seed[name] for name in limb.joint_names()])
    return limb.joint_names(), Swing(rows, arguments.period)


def wave(arguments):
    RobotEnable(CHECK_VERSION).enable()
    limbs = [Limb(side) for side in SIDES]
    rospy.loginfo("hands up")
    with ThreadPoolExecutor(len(limbs)) as pool:
        arrived = list(pool.map(lambda limb: limb.move_to_joint_positions(hands_up(limb.name)), limbs))
    if not all(arrived):
        raise LabProgramFailed("not every arm got up; the lines above say why")
    plans = [plan(limb, arguments) for limb in limbs]
    rospy.loginfo("waving for %g s", arguments.seconds)
    rate, begin_s, elapsed_s = rospy.Rate(RATE_HZ, reset=True), rospy.get_time(), 0.0
    while not rospy.is_shutdown() and elapsed_s < arguments.seconds:
        elapsed_s = min(rospy.get_time() - begin_s, arguments.seconds)
        for limb, (names, swing) in zip(limbs, plans, strict=True):
            limb.set_joint_positions(dict(zip(names, swing.angles(elapsed_s, arguments.seconds), strict=True)))
        rate.sleep()
    for limb in limbs:
        limb.exit_control_mode()


def main():
    arguments = parse_arguments(rospy.myargv()[1:])
    return run("wave", lambda: wave(arguments))


if __name__ == "__main__":
    sys.exit(main())
