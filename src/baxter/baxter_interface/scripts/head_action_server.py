#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Serve robot/head/head_action.

Publishes: robot/head/command_head_pan. Subscribes: robot/head/head_state, robot/state. dynamic_reconfigure has its
parameters.
"""
import argparse
import functools
import sys

import rospy
from baxter_interface.cfg import HeadActionServerConfig

from baxter_interface import programs
from baxter_interface.dynamic_parameters import ParameterServer
from baxter_interface.serving import serve
from head_action.head_action import HeadActionServer


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.parse_args(rospy.myargv()[1:])

    def body():
        config = ParameterServer(HeadActionServerConfig, lambda config, level: config)
        serve([functools.partial(HeadActionServer, config)], "head action server")

    return programs.run("rsdk_head_action_server", body)


if __name__ == "__main__":
    sys.exit(main())
