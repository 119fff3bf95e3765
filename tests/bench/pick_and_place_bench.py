#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Pick and place a block by friction in lock-step, one trial per seed: success rate and speed.

    python tests/bench/pick_and_place_bench.py [--seeds 100] [--first 0] [--profile robot] [--serial 0]
        [--looking | --tagged]

With `--profile robot` the arm has a physical robot's effects, with `--serial N` it is that robot's. With `--looking`
the arm knows the block's target, but not its pose: it finds the block with the hand's camera and the range sensor.
With `--tagged` it finds a block with a tag, by the camera alone.
The robot's own plugin on the real physics, without a master. Commands are messages at 100 Hz of simulation time;
simulation time passes only between them. A seed decides the block's pose, its target, its mass, its friction, and the
arm's start posture.
"""
import argparse
import math
import sys
import time
from dataclasses import astuple, dataclass, field, replace

import numpy as np
import rospkg
from baxter_core_msgs.msg import EndEffectorCommand
from hand_eye import Eye
from robot_bench import load_lab

import xacro
from arm_kinematics import Chain, NoSolution, pose_from_quaternion, solve
from baxter_interface.joint_motion import Move
from baxter_sim_examples import BASE_HEIGHT_M, BLOCK_SIZE_M, TABLE_XY_M, BlockLost, Trial, block_urdf, pick_and_place
from baxter_sim_examples.looking import NotSeen, locate, locate_tagged
from baxter_sim_examples.pick_and_place import aside_angles, grip_yaw
from baxter_sim_examples.scene import ABOUT_M, MIDDLE_M
from baxter_sim_examples.tagged import tagged_block_urdf
from baxter_sim_hardware import effects, individual
from bullet_sim import Pose
from model_files.resources import model_folders
from sdf_model import ModelFolders, parse_sdf_model
from urdf_model import parse_urdf

PERIOD_S = 0.01  # of commands
LONGEST_S = 15.0  # of a motion, as in the SDK
STATE = "end_effector/left_gripper/state"
RANGE = "range/left_hand_range/state"
FEELING_S, SETTLING_S = 1.0, 1.0  # on one place; before an arm that looks does anything but move
NEEDED = 0.95
# The block must end at most this far from the target [m], standing on a face.
MISS_M, HEIGHT_M = 0.01, 0.002


class Failure(Exception):
    """A trial that did not succeed; the text says why."""


class LabArm:
    """The left arm of a Lab, with the interface that `pick_and_place` needs. With the right arm's chain, `move_to`
    moves that one."""

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

    def calibrate(self):
        """A physical robot's gripper wants it after it was switched on."""
        self._run(0.1)
        if not self._lab.last(STATE).calibrated:
            self._tell("calibrate")

    def _grip(self, percent):
        self._tell("go", '{"position": %g}' % percent)

    def _tell(self, command, arguments=""):
        message = EndEffectorCommand(command=command, args=arguments)
        self._lab.send("end_effector/left_gripper/command", message)
        self._run(0.1)
        end_s = self._lab.world.time_s + LONGEST_S
        while self._lab.last(STATE).moving:
            if self._lab.world.time_s > end_s:
                raise Failure("the fingers did not come to rest after '%s %s'" % (command, arguments))
            self._run(PERIOD_S)

    def _run(self, seconds):
        self._lab.run(seconds)
        self.watch()

    def _read(self):
        position, velocity, _ = self._lab.plugin.read_joints()
        return [dict(zip(self._names, values[self._index].tolist(), strict=True)) for values in (position, velocity)]


class SeeingArm(LabArm):
    """The same with the hand's camera and range sensor, as `locate` wants it."""

    def __init__(self, lab, chain, robot, eye):
        super().__init__(lab, chain)
        self._eye, self._sensor = eye, Chain.from_robot(robot, base="base", tip="left_hand_range")

    def look(self):
        self._settle()
        return self._eye.view()

    def feel(self):
        self._settle()
        messages, heights = self._lab.publishers[RANGE].messages, []
        messages.clear()
        end_s = self._lab.world.time_s + FEELING_S
        while self._lab.world.time_s < end_s:
            self._run(PERIOD_S)
            position, _ = self._read()
            heights.append(self._sensor.fk(np.array([position[name] for name in self._sensor.joint_names]))[2, 3])
        return float(np.mean(heights)), [message.range for message in messages]

    def _grip(self, percent):
        self._settle()
        super()._grip(percent)

    def _settle(self):
        """The motors' deflection comes back at rest."""
        self._run(SETTLING_S)


def world_pose(spot):
    """A Spot as a pose in the physics world."""
    turn = (0.0, 0.0, math.sin(spot.yaw / 2.0), math.cos(spot.yaw / 2.0))
    return Pose((spot.x, spot.y, spot.z + BASE_HEIGHT_M), turn)


def described(serial):
    """The description (URDF text) of the robot with this serial number."""
    file = rospkg.RosPack().get_path("baxter_description") + "/urdf/baxter.urdf.xacro"
    rows = effects.read(effects.physical_robot())["serial"]
    return individual.described(xacro.process_file(file).toxml(), serial, rows)


def load_scene(serial=individual.DRAWING):
    """(robot, table) as urdf_model.Robot; the robot with this serial number."""
    table = ModelFolders(model_folders()).find("model://cafe_table")
    return (parse_urdf(described(serial), source="robot %d" % serial),
            parse_sdf_model(table.read_text(), str(table)).robot)


def run(lab_class, robot, table, trial, parameters=None, looking=None, tagged=False):
    """One trial. Returns (simulated seconds, distance from the target [m]).

    parameters: those of baxter_sim_hardware, beside `enable`; looking: the robot's description, if the arm must
    find the block itself, by its tag if ``tagged``. Raises Failure, BlockLost, NoSolution, NotSeen.
    """
    eye = None
    lab = lab_class(robot, pose="untucked", parameters={"enable": True, **(parameters or {})}, meshes=True)
    try:
        for topic, publisher in lab.publishers.items():
            publisher.has_listeners = topic in (STATE, RANGE)
        index = lab.model.index(list(trial.start))
        lab.model.set_joint_positions(index, np.array(list(trial.start.values())))
        lab.plugin.joints_set()
        lab.world.spawn(table, "cafe_table", Pose((*TABLE_XY_M, 0.0)), static=True)
        block_xml = (tagged_block_urdf if tagged else block_urdf)(trial.mass_kg, trial.friction)
        block = lab.world.spawn(parse_urdf(block_xml, source="block"), "block", world_pose(trial.source))
        chain, height, source = Chain.from_robot(robot, base="base", tip="left_gripper"), [], trial.source
        if looking is not None:
            eye = Eye(lab, robot, looking, block, block_xml, parameters or {})
        arm = LabArm(lab, chain) if eye is None else SeeingArm(lab, chain, robot, eye)
        arm.watch = lambda: height.append(block.base_pose().position[2])
        target = trial.target
        arm.calibrate()
        LabArm(lab, Chain.from_robot(robot, base="base", tip="right_gripper")).move_to(aside_angles("right"))
        if eye is not None:
            source = (locate_tagged if tagged else locate)(arm, MIDDLE_M, ABOUT_M)
            target = replace(target, z=source.z)
            print("seen %.1f mm beside the block, %.1f mm too high, turned by %.1f degrees" % (
                1e3 * math.dist(astuple(source)[:2], astuple(trial.source)[:2]), 1e3 * (source.z - trial.source.z),
                math.degrees(grip_yaw(source.yaw - trial.source.yaw))), flush=True)
        pick_and_place(arm, source, target)
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
        if eye is not None:
            eye.close()
        lab.close()


@dataclass
class Outcome:
    """Results of some seeds. misses_m: the block's final distance from its target, for each success."""

    succeeded: int = 0
    misses_m: list = field(default_factory=list)
    simulated_s: float = 0.0
    wall_s: float = 0.0
    cpu_s: float = 0.0


def run_seeds(seeds, profile="sim", serial=individual.DRAWING, looks=False, tagged=False):
    """Run one trial per seed, on the robot `serial` with that profile; print the reason of each failure."""
    robot, table = load_scene(serial)
    looking = described(serial) if looks or tagged else None
    lab_class = load_lab()
    outcome = Outcome()
    begin, begin_cpu = time.monotonic(), time.process_time()
    for seed in seeds:
        try:
            seconds, miss = run(lab_class, robot, table, Trial.from_seed(seed), {"profile": profile, "serial": serial},
                                looking, tagged)
        except (Failure, BlockLost, NoSolution, NotSeen) as failure:
            print("seed %d failed: %s" % (seed, failure), flush=True)
            continue
        outcome.succeeded += 1
        outcome.simulated_s += seconds
        outcome.misses_m.append(miss)
    outcome.wall_s, outcome.cpu_s = time.monotonic() - begin, time.process_time() - begin_cpu
    return outcome


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=100, help="number of seeds (default: %(default)s)")
    parser.add_argument("--first", type=int, default=0, help="the first seed (default: %(default)s)")
    parser.add_argument("--profile", choices=("sim", "robot"), default="sim", help="(default: %(default)s)")
    parser.add_argument("--serial", type=int, default=individual.DRAWING, help="of the robot (default: %(default)s)")
    ways = parser.add_mutually_exclusive_group()
    ways.add_argument("--looking", action="store_true", help="the arm finds the block by looking and feeling")
    ways.add_argument("--tagged", action="store_true", help="the arm finds the block by the tag on it")
    arguments = parser.parse_args()
    outcome = run_seeds(range(arguments.first, arguments.first + arguments.seeds), arguments.profile, arguments.serial,
                        arguments.looking, arguments.tagged)
    print("%d of %d succeeded; worst distance from the target %.2f mm; %.1f simulated s a run; %.1f times real time by "
          "the clock, %.1f by processor time" % (
              outcome.succeeded, arguments.seeds, 1e3 * max(outcome.misses_m, default=0.0),
              outcome.simulated_s / max(outcome.succeeded, 1), outcome.simulated_s / outcome.wall_s,
              outcome.simulated_s / outcome.cpu_s))
    return 0 if outcome.succeeded >= NEEDED * arguments.seeds else 1


if __name__ == "__main__":
    sys.exit(main())
