#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Wave with both arms: the grippers go to and fro along y as a sine, each on its side."""
import math
import sys

import rospy

import baxter_interface

CENTRES = {"left": (0.6, 0.35, 0.3), "right": (0.6, -0.35, 0.3)}  # of the grippers in base [m]
DOWN = (0.0, 1.0, 0.0, 0.0)  # x y z w: fingers downwards
AMPLITUDE_M, PERIOD_S, PERIODS, RATE_HZ = 0.08, 4.0, 4, 50


def plan(limb):
    """Joint angles (dicts) along one period: first all of the path, then the motion."""
    x, y, z = CENTRES[limb.name]
    path, seed = [], None
    steps = round(PERIOD_S * RATE_HZ)
    # IK runs at every fifth step; the angles between are interpolated.
    for k in range(0, steps, 5):
        offset = AMPLITUDE_M * math.sin(2.0 * math.pi * k / steps)
        # Each solution near the one before: the elbow must not change sides on the way.
        seed = limb.ik(((x, y + offset, z), DOWN), seed=seed)
        path.append(seed)
    return [{name: first[name] + part / 5.0 * (second[name] - first[name]) for name in first}
            for first, second in zip(path, [*path[1:], path[0]], strict=True) for part in range(5)]


def main():
    rospy.init_node("wave_solution")
    baxter_interface.RobotEnable().enable()
    limbs = [baxter_interface.Limb(side) for side in CENTRES]
    plans = [plan(limb) for limb in limbs]
    for limb, angles in zip(limbs, plans, strict=True):
        limb.move_to_joint_positions(angles[0])
    rate = rospy.Rate(RATE_HZ)
    for k in range(PERIODS * len(plans[0])):
        for limb, angles in zip(limbs, plans, strict=True):
            limb.set_joint_positions(angles[k % len(angles)])
        rate.sleep()
    for limb in limbs:
        limb.exit_control_mode()
    return 0


if __name__ == "__main__":
    sys.exit(main())
