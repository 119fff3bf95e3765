# SPDX-License-Identifier: BSD-3-Clause
"""Put the things of a task into a lab, for whoever shows the task there."""
from __future__ import annotations

import argparse
import sys

import numpy as np
import rospy

from command_line.options import MAX_SEED, Parser, number
from gazebo_ros.gazebo_interface import GazeboInterfaceError
from gym_baxter.tasks import STAGE_TASKS
from rospy_nodes.start import limit_ports

from .robot import RosRobot
from .scene import RosLab


def parse(arguments: list[str]) -> argparse.Namespace:
    """The command line's options."""
    parser = Parser(prog="things", description="Put the things of a task into the simulator, or move them if they are "
                    "there: where an episode of that seed begins. Nothing else moves.")
    parser.add_argument("task", choices=tuple(STAGE_TASKS), metavar="TASK", help="one of %s" % ", ".join(STAGE_TASKS))
    parser.add_argument("--seed", type=number(int, 0, MAX_SEED), default=0, help="of the episode (default: 0)")
    return parser.parse_args(arguments)


def put(name: str, seed: int) -> str:
    """Put up a task's things in a node; returns what is to be done with them. Raises GazeboInterfaceError, KeyError."""
    task = STAGE_TASKS[name](RosLab(RosRobot()))
    task.begin(np.random.default_rng(seed))
    goal = getattr(task, "goal", None)
    return task.SENTENCE if goal is None else "%s It is at x %.2f, y %.2f, z %.2f m in the frame base." % (
        task.SENTENCE, *goal)


def main() -> None:
    """The program."""
    options = parse(rospy.myargv()[1:])
    limit_ports()
    try:
        rospy.init_node("things", anonymous=True)
        print(put(options.task, options.seed))
    except KeyError as error:
        sys.exit("things: there is no parameter %s; start the robot first" % error)
    except (GazeboInterfaceError, ValueError, rospy.ROSInitException) as error:
        sys.exit("things: %s" % error)
