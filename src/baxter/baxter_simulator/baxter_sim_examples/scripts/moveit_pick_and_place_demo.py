#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The left arm carries a block through clutter, with grasps and places that MoveIt's interface is given.

Parameters: ~trials: how many seeds are tried, 0 for ever; ~seed: the first of them. It fails if one of them does.
"""
import argparse
import itertools
import sys

import rospy

from baxter_interface.programs import EnabledRobot, expect, run
from baxter_sim_examples.moveit_trial import MoveItTrials, TrialFailed
from gazebo_ros.gazebo_interface import GazeboInterfaceError


def demo() -> None:
    count, first = rospy.get_param("~trials", 0), rospy.get_param("~seed", 0)
    done, misses = 0, []
    with EnabledRobot():
        trials = MoveItTrials()
        for seed in itertools.count(first) if count == 0 else range(first, first + count):
            try:
                misses.append(trials.run(seed))
                rospy.loginfo("seed %d: the block is %.1f mm from where it should be; nothing else was touched", seed,
                              1e3 * misses[-1])
            except (TrialFailed, GazeboInterfaceError) as failure:
                rospy.logwarn("seed %d failed: %s", seed, failure)
            done += 1
            rospy.loginfo("%d of %d succeeded", len(misses), done)
    expect(len(misses) == done, "%d of %d failed" % (done - len(misses), done))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.parse_known_args()
    sys.exit(run("moveit_pick_and_place_demo", demo))
