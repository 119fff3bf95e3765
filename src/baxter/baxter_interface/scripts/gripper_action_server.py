#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Serve robot/end_effector/<gripper>/gripper_action for one gripper or both.

Actions: robot/end_effector/SIDE_gripper/gripper_action. Publishes: robot/end_effector/SIDE_gripper/command.
Subscribes: state and properties beside it, robot/state. dynamic_reconfigure has its parameters.
"""
import argparse
import functools
import sys

import rospy
from baxter_interface.cfg import GripperActionServerConfig

from baxter_interface import programs
from baxter_interface.dynamic_parameters import ParameterServer
from baxter_interface.serving import serve
from baxter_model import SIDES
from gripper_action.gripper_action import GripperActionServer


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-g", "--gripper", choices=("both", *SIDES), default="both", help="which gripper (both)")
    arguments = parser.parse_args(rospy.myargv()[1:])
    sides = SIDES if arguments.gripper == "both" else (arguments.gripper,)

    def body():
        config = ParameterServer(GripperActionServerConfig, lambda config, level: config)
        serve([functools.partial(GripperActionServer, side, config) for side in sides],
              "gripper action server, grippers: %s" % " ".join(sides))

    suffix = "" if arguments.gripper == "both" else "_" + arguments.gripper
    return programs.run("rsdk_gripper_action_server%s" % suffix, body)


if __name__ == "__main__":
    sys.exit(main())
