#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The left arm carries a block on a table from one spot to another and back.

Parameters: ~rounds: how many ways, 0 for ever; ~seed: decides where the block lies, its mass and its friction.
"""
import itertools
import sys

import rospy

from baxter_interface import Gripper, Limb
from baxter_interface.programs import EnabledRobot, ProgramFailed, expect, run
from baxter_sim_examples import BlockLost, Trial, pick_and_place
from baxter_sim_examples.gazebo_scene import GazeboScene
from gazebo_ros.gazebo_interface import GazeboInterfaceError

MISS_M = 0.01  # largest distance of a block that reached its target


class SdkArm:
    """An arm with its gripper, as `pick_and_place` wants it."""

    def __init__(self, limb):
        self.name = limb
        self._limb, self._gripper = Limb(limb), Gripper(limb)
        if not self._gripper.calibrated():
            expect(self._gripper.calibrate(), "the %s gripper cannot be calibrated" % limb)

    def ik(self, position, orientation, seed):
        return self._limb.ik((position, orientation), seed)

    def move_to(self, angles):
        expect(self._limb.move_to_joint_positions(angles), "the %s arm did not get where it should" % self.name)
        return angles

    def open(self):
        expect(self._gripper.open(block=True), "the %s gripper does not open" % self.name)

    def close(self):
        expect(self._gripper.close(block=True), "the %s gripper does not close" % self.name)

    def holds(self):
        return self._gripper.gripping()


def demo():
    rounds, seed = rospy.get_param("~rounds", 0), rospy.get_param("~seed", 0)
    trial = Trial.from_seed(seed)
    spots = itertools.cycle([trial.source, trial.target])
    source = next(spots)
    try:
        with EnabledRobot(), GazeboScene(trial) as scene:
            rospy.loginfo("a block of %.0f g with friction %.2f", 1e3 * trial.mass_kg, trial.friction)
            arm = SdkArm("left")
            for way in itertools.count(1):
                target = next(spots)
                pick_and_place(arm, source, target)
                miss = scene.distance(target)
                expect(miss < MISS_M, "the block is %.0f mm from where it should be" % (1e3 * miss))
                rospy.loginfo("way %d: the block is %.1f mm from where it should be", way, 1e3 * miss)
                source = target
                if way == rounds:
                    return
    except (BlockLost, GazeboInterfaceError) as failure:
        raise ProgramFailed(str(failure)) from failure


if __name__ == "__main__":
    sys.exit(run("ik_pick_and_place_demo", demo))
