#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Serve robot/limb/<limb>/follow_joint_trajectory for one arm or both.

Actions: robot/limb/SIDE/follow_joint_trajectory. Publishes: robot/limb/SIDE/joint_command,
.../inverse_dynamics_command, robot/joint_state_publish_rate. Subscribes: robot/state, robot/joint_states, the
cuffs' switches.
dynamic_reconfigure has its parameters: tolerances and gains of each joint.
"""
import argparse
import functools
import sys

import rospy
from baxter_interface.cfg import (
    PositionFFJointTrajectoryActionServerConfig,
    PositionJointTrajectoryActionServerConfig,
    VelocityJointTrajectoryActionServerConfig,
)

from baxter_interface import programs
from baxter_interface.dynamic_parameters import ParameterServer
from baxter_interface.serving import serve
from baxter_model import SIDES
from joint_trajectory_action.joint_trajectory_action import JointTrajectoryActionServer

CONFIGS = {
    "position_w_id": PositionFFJointTrajectoryActionServerConfig,
    "position": PositionJointTrajectoryActionServerConfig,
    "velocity": VelocityJointTrajectoryActionServerConfig,
}


def positive(text: str) -> float:
    number = float(text)
    if not 0.0 < number <= 1000.0:
        raise argparse.ArgumentTypeError("the rate must be above 0 and at most 1000 Hz, got %s" % text)
    return number


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-l", "--limb", choices=("both", *SIDES), default="both", help="which arm (both)")
    parser.add_argument("-r", "--rate", type=positive, default=100.0, help="commands per second [Hz] (100)")
    parser.add_argument("-m", "--mode", choices=CONFIGS, default="position_w_id",
                        help="how the arm is commanded (position_w_id)")
    arguments = parser.parse_args(rospy.myargv()[1:])
    limbs = SIDES if arguments.limb == "both" else (arguments.limb,)

    def body():
        config = ParameterServer(CONFIGS[arguments.mode], lambda config, level: config)
        serve([functools.partial(JointTrajectoryActionServer, limb, config, arguments.rate, arguments.mode)
               for limb in limbs], "trajectory server, %s, arms: %s" % (arguments.mode, " ".join(limbs)))

    suffix = "" if arguments.limb == "both" else "_" + arguments.limb
    return programs.run("rsdk_%s_joint_trajectory_action_server%s" % (arguments.mode, suffix), body)


if __name__ == "__main__":
    sys.exit(main())
