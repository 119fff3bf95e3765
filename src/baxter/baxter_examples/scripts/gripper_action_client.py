#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Open and close a gripper through its action server."""
import sys

from control_msgs.msg import GripperCommandAction, GripperCommandGoal

from baxter_examples.action_client import ActionClient
from baxter_examples.arguments import new_parser, parse
from baxter_interface.programs import EnabledRobot, run
from baxter_model import SIDES

# Position [%] and force [%].
GOALS = ((0.0, 50.0), (100.0, 50.0), (25.0, 40.0), (75.0, 20.0), (0.0, 30.0), (100.0, 40.0))
TIMEOUT_S = 5.0


def move(side: str) -> None:
    client = ActionClient("robot/end_effector/%s_gripper/gripper_action" % side, GripperCommandAction,
                          "rosrun baxter_interface gripper_action_server.py")
    with EnabledRobot():
        for position, effort in GOALS:
            goal = GripperCommandGoal()
            goal.command.position, goal.command.max_effort = position, effort
            client.send(goal)
            result = client.wait(TIMEOUT_S)
            print("commanded %.0f %%: the %s gripper is at %.1f %%" % (position, side, result.position), flush=True)


def main() -> int:
    parser = new_parser(__doc__)
    parser.add_argument("-g", "--gripper", required=True, choices=SIDES, help="the gripper")
    side = parse(parser).gripper
    return run("rsdk_gripper_action_client_%s" % side, lambda: move(side))


if __name__ == "__main__":
    sys.exit(main())
