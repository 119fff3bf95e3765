#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Turn the head through its action server."""
import sys

from control_msgs.msg import SingleJointPositionAction, SingleJointPositionGoal

from baxter_examples.action_client import ActionClient
from baxter_examples.arguments import new_parser, parse
from baxter_interface.programs import EnabledRobot, run

# Angle [rad] and share of full speed.
GOALS = ((0.0, 1.0), (1.57, 0.1), (0.0, 0.8), (-1.0, 0.4), (0.0, 0.6))
TIMEOUT_S = 5.0


def turn() -> None:
    client = ActionClient("robot/head/head_action", SingleJointPositionAction,
                          "rosrun baxter_interface head_action_server.py")
    with EnabledRobot():
        for angle, speed in GOALS:
            client.send(SingleJointPositionGoal(position=angle, max_velocity=speed))
            client.wait(TIMEOUT_S)
            print("the head is at %.2f rad" % angle, flush=True)


def main() -> int:
    parse(new_parser(__doc__))
    return run("rsdk_head_action_client", turn)


if __name__ == "__main__":
    sys.exit(main())
