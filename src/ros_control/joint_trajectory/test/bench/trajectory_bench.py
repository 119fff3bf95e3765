#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Times of a tick of trajectory following, and of a new command.

    ./baxter.sh sim src/ros_control/joint_trajectory/test/bench/trajectory_bench.py [--joints 6] [--points 100]
"""
import argparse
import timeit

import numpy as np

from joint_trajectory import Follower, Tolerances, TrajectoryCommand, bounds


def microseconds(function, repetitions):
    """The best of five rounds, per call."""
    return min(timeit.repeat(function, number=repetitions, repeat=5)) / repetitions * 1e6


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--joints", type=int, default=6)
    parser.add_argument("--points", type=int, default=100)
    arguments = parser.parse_args()
    count = arguments.joints
    names = ["joint_%d" % i for i in range(count)]
    rng = np.random.default_rng(0)
    points = [(float(i + 1), *rng.normal(size=(3, count)).tolist()) for i in range(arguments.points)]
    still = np.zeros(count)
    follower = Follower(names)
    follower.start(0.0, still, still)
    command = TrajectoryCommand(names, points)
    tolerances = Tolerances(bounds(count, position=100.0), bounds(count, position=0.1, velocity=0.01), 0.0)
    out = np.empty((3, count))
    middle = arguments.points / 2 + 0.3

    def accept():
        follower.accept(command, 0.002, still, goal="goal", tolerances=tolerances)

    accept()
    print("%d joints, %d points [us]" % (count, arguments.points))
    print("sample              %8.2f" % microseconds(lambda: follower.trajectory.sample(middle, out), 20000))
    print("update with a goal  %8.2f" % microseconds(lambda: follower.update(middle, still, still), 20000))
    print("check a command     %8.1f" % microseconds(lambda: TrajectoryCommand(names, points), 50))
    print("accept a command    %8.1f" % microseconds(accept, 200))


if __name__ == "__main__":
    main()
