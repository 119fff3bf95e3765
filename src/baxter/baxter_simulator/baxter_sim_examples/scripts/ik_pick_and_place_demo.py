#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The left arm carries a block on a table from one spot to another and back.

Parameters: ~rounds: how many ways, 0 for ever; ~seed: decides where the block lies, its mass and its friction;
~looking: the arm is not told where the block lies, but looks with the camera of its hand, and feels for the table.
"""
from __future__ import annotations

import argparse
import itertools
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import rospy
from tf2_ros import TransformException

from baxter_interface import Gripper, Limb
from baxter_interface.programs import EnabledRobot, ProgramFailed, expect, run
from baxter_sim_examples import BlockLost, Trial, pick_and_place
from baxter_sim_examples.gazebo_scene import GazeboScene
from baxter_sim_examples.hand_senses import HandSenses
from baxter_sim_examples.looking import NotSeen, locate
from baxter_sim_examples.pick_and_place import aside_angles
from baxter_sim_examples.scene import ABOUT_M, MIDDLE_M
from gazebo_ros.gazebo_interface import GazeboInterfaceError

if TYPE_CHECKING:
    from baxter_sim_examples.looking import CameraView

MISS_M = 0.01  # largest distance of a block that reached its target
STARTING_S = 30.0  # [wall] for the IK service, which may start beside this program on a busy machine
SETTLING_S = 1.0  # [ROS time] until a physical arm that has arrived is at rest


class SdkArm:
    """An arm with its gripper, as `pick_and_place` wants it."""

    def __init__(self, limb: str) -> None:
        self.name = limb
        self._limb, self._gripper = Limb(limb), Gripper(limb)
        if not self._gripper.calibrated():
            expect(self._gripper.calibrate(), "the %s gripper cannot be calibrated" % limb)

    def ik(self, position: Sequence[float], orientation: Sequence[float],
           seed: Mapping[str, float]) -> dict[str, float]:
        return self._limb.ik((position, orientation), seed, timeout=STARTING_S)

    def move_to(self, angles: dict[str, float]) -> dict[str, float]:
        expect(self._limb.move_to_joint_positions(angles), "the %s arm did not get where it should" % self.name)
        return angles

    def open(self) -> None:
        expect(self._gripper.open(block=True), "the %s gripper does not open" % self.name)

    def close(self) -> None:
        expect(self._gripper.close(block=True), "the %s gripper does not close" % self.name)

    def holds(self) -> bool:
        return self._gripper.gripping()


class SeeingArm(SdkArm):
    """The same with the hand's camera and range sensor, as `locate` wants it, for an arm that comes to rest slowly."""

    def __init__(self, limb: str) -> None:
        super().__init__(limb)
        self._senses = HandSenses(limb)

    def look(self) -> CameraView:
        rospy.sleep(SETTLING_S)
        return self._senses.look()

    def feel(self) -> tuple[float, list[float]]:
        rospy.sleep(SETTLING_S)
        return self._senses.feel()

    def open(self) -> None:
        rospy.sleep(SETTLING_S)
        super().open()

    def close(self) -> None:
        rospy.sleep(SETTLING_S)
        super().close()


def demo() -> None:
    rounds, seed = rospy.get_param("~rounds", 0), rospy.get_param("~seed", 0)
    looks = rospy.get_param("~looking", False)
    trial = Trial.from_seed(seed)
    spots = itertools.cycle([trial.source, trial.target])
    source = next(spots)
    try:
        with EnabledRobot(), GazeboScene(trial) as scene:
            rospy.loginfo("a block of %.0f g with friction %.2f", 1e3 * trial.mass_kg, trial.friction)
            expect(Limb("right").move_to_joint_positions(aside_angles("right")), "the right arm does not go aside")
            arm = SeeingArm("left") if looks else SdkArm("left")
            for way in itertools.count(1):
                target = next(spots)
                if isinstance(arm, SeeingArm):
                    source = locate(arm, MIDDLE_M, ABOUT_M)
                    rospy.loginfo("the block is seen %.1f mm from where it is", 1e3 * scene.distance(source))
                pick_and_place(arm, source, replace(target, z=source.z))
                miss = scene.distance(target)
                expect(miss < MISS_M, "the block is %.0f mm from where it should be" % (1e3 * miss))
                rospy.loginfo("way %d: the block is %.1f mm from where it should be", way, 1e3 * miss)
                source = target
                if way == rounds:
                    return
    except (BlockLost, NotSeen, GazeboInterfaceError, TransformException) as failure:
        raise ProgramFailed(str(failure)) from failure


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.parse_known_args()
    sys.exit(run("ik_pick_and_place_demo", demo))
