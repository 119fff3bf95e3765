#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Pick and place a block by friction, seed after seed, in lock-step: how many succeed, and how fast.

    python tests/bench/pick_and_place_bench.py [--seeds 100] [--first 0]

The robot's own plugin on the real physics, without a master: commands go in as messages, at 100 Hz of simulation time,
and no time passes between them but what they ask for. A seed decides where the block lies, how it is turned, where it
shall go, its mass, its friction, and the pose that the arm starts in.
"""
import argparse
import math
import sys
import time
from dataclasses import dataclass, field

import numpy as np
import rospkg
from baxter_core_msgs.msg import EndEffectorCommand
from robot_bench import load_lab

import xacro
from baxter_interface.joint_motion import Move
from baxter_sim_examples import BASE_HEIGHT_M, BLOCK_SIZE_M, TABLE_XY_M, BlockLost, Trial, block_urdf, pick_and_place
from baxter_sim_kinematics import Chain, NoSolution, pose_from_quaternion, solve
from bullet_sim import Pose
from model_files.resources import model_folders
from sdf_model import ModelFolders, parse_sdf_model
from urdf_model import parse_urdf

PERIOD_S = 0.01  # of commands
LONGEST_S = 15.0  # of a move, as in the SDK
STATE = "end_effector/left_gripper/state"
NEEDED = 0.95
# Where the block must end: beside the target by at most so much [m], standing on a face.
MISS_M, HEIGHT_M = 0.01, 0.002


class Failure(Exception):
    """A trial that did not succeed; the text says why."""


class LabArm:
    """The left arm of a Lab, as `pick_and_place` wants it."""

    name = "left"

    def __init__(self, lab, chain):
        self._lab, self._chain = lab, chain
        self._names = chain.joint_names
        self._index = lab.model.index(self._names)
        self.watch = lambda: None

    def ik(self, position, orientation, seed):
        target = pose_from_quaternion(position, orientation)
        result = solve(self._chain, target, seed=[seed[name] for name in self._names])
        return dict(zip(self._names, result.q.tolist(), strict=True))

    def move_to(self, angles):
        position, _ = self._read()
        move, elapsed = Move(position, angles, LONGEST_S), 0.0
        while True:
            step = move.step(elapsed, *self._read())
            if step.command is not None:
                self._lab.command(1, list(step.command.values()), list(step.command))
            if step.failure:
                raise Failure(step.failure)
            if step.is_last:
                return angles
            self._run(PERIOD_S)
            elapsed += PERIOD_S

    def open(self):
        self._grip(100.0)

    def close(self):
        self._grip(0.0)

    def holds(self):
        return self._lab.last(STATE).gripping == 1

    def _grip(self, percent):
        message = EndEffectorCommand(command="go", args='{"position": %g}' % percent)
        self._lab.send("end_effector/left_gripper/command", message)
        self._run(0.1)
        end_s = self._lab.world.time_s + LONGEST_S
        while self._lab.last(STATE).moving:
            if self._lab.world.time_s > end_s:
                raise Failure("the fingers did not come to rest at %.0f %%" % percent)
            self._run(PERIOD_S)

    def _run(self, seconds):
        self._lab.run(seconds)
        self.watch()

    def _read(self):
        position, velocity, _ = self._lab.model.read_joints()
        return [dict(zip(self._names, values[self._index].tolist(), strict=True)) for values in (position, velocity)]


def world_pose(spot):
    """A Spot as a pose in the physics world."""
    turn = (0.0, 0.0, math.sin(spot.yaw / 2.0), math.cos(spot.yaw / 2.0))
    return Pose((spot.x, spot.y, spot.z + BASE_HEIGHT_M), turn)


def load_scene():
    """(robot, table) as urdf_model.Robot."""
    file = rospkg.RosPack().get_path("baxter_description") + "/urdf/baxter.urdf.xacro"
    table = ModelFolders(model_folders()).find("model://cafe_table")
    return (parse_urdf(xacro.process_file(file).toxml(), source=file),
            parse_sdf_model(table.read_text(), str(table)).robot)


def run(lab_class, robot, table, trial):
    """One trial. Returns (simulated seconds, distance from the target [m]); raises Failure, BlockLost, NoSolution."""
    lab = lab_class(robot, pose="untucked", parameters={"enable": True}, meshes=True)
    try:
        for topic, publisher in lab.publishers.items():
            publisher.has_listeners = topic == STATE
        index = lab.model.index(list(trial.start))
        lab.model.set_joint_positions(index, np.array(list(trial.start.values())))
        lab.plugin.joints_set()
        lab.world.spawn(table, "cafe_table", Pose((*TABLE_XY_M, 0.0)), static=True)
        block = parse_urdf(block_urdf(trial.mass_kg, trial.friction), source="block")
        block = lab.world.spawn(block, "block", world_pose(trial.source))
        arm = LabArm(lab, Chain.from_robot(robot, base="base", tip="left_gripper"))
        height = []
        arm.watch = lambda: height.append(block.base_pose().position[2])
        pick_and_place(arm, trial.source, trial.target)
        lab.run(1.0)
        end, wanted = block.base_pose(), world_pose(trial.target)
        miss = math.dist(end.position[:2], wanted.position[:2])
        if miss > MISS_M or abs(end.position[2] - wanted.position[2]) > HEIGHT_M:
            raise Failure("the block ended %.1f mm beside its target, %.1f mm above it" % (
                1e3 * miss, 1e3 * (end.position[2] - wanted.position[2])))
        if max(height) < wanted.position[2] + 2.0 * BLOCK_SIZE_M:
            raise Failure("the block was pushed, not lifted")
        return lab.world.time_s, miss
    finally:
        lab.close()


@dataclass
class Outcome:
    """What became of some seeds. misses_m: of those that succeeded, how far from its target the block ended."""

    succeeded: int = 0
    misses_m: list = field(default_factory=list)
    simulated_s: float = 0.0
    wall_s: float = 0.0
    cpu_s: float = 0.0


def run_seeds(seeds):
    """One trial for each seed; prints why one failed."""
    robot, table = load_scene()
    lab_class = load_lab()
    outcome = Outcome()
    begin, begin_cpu = time.monotonic(), time.process_time()
    for seed in seeds:
        try:
            seconds, miss = run(lab_class, robot, table, Trial.from_seed(seed))
        except (Failure, BlockLost, NoSolution) as failure:
            print("seed %d failed: %s" % (seed, failure), flush=True)
            continue
        outcome.succeeded += 1
        outcome.simulated_s += seconds
        outcome.misses_m.append(miss)
    outcome.wall_s, outcome.cpu_s = time.monotonic() - begin, time.process_time() - begin_cpu
    return outcome


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=100, help="how many (default: %(default)s)")
    parser.add_argument("--first", type=int, default=0, help="the first one (default: %(default)s)")
    arguments = parser.parse_args()
    outcome = run_seeds(range(arguments.first, arguments.first + arguments.seeds))
    print("%d of %d succeeded; worst distance from the target %.2f mm; %.1f simulated s a run; %.1f times real time by "
          "the clock, %.1f by processor time" % (
              outcome.succeeded, arguments.seeds, 1e3 * max(outcome.misses_m, default=0.0),
              outcome.simulated_s / max(outcome.succeeded, 1), outcome.simulated_s / outcome.wall_s,
              outcome.simulated_s / outcome.cpu_s))
    return 0 if outcome.succeeded >= NEEDED * arguments.seeds else 1


if __name__ == "__main__":
    sys.exit(main())
