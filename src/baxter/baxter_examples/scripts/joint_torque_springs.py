#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Hold an arm by virtual springs: push it, and it comes back. Set them with rqt_reconfigure, or dynparam."""
import sys

import rospy
from baxter_examples.cfg import JointSpringsExampleConfig
from std_msgs.msg import Empty

from baxter_examples.arguments import add_limb, new_parser, parse
from baxter_examples.springs import spring_torques
from baxter_interface import Limb
from baxter_interface.dynamic_parameters import ParameterServer
from baxter_interface.programs import EnabledRobot, expect, run
from baxter_model import JOINTS

RATE_HZ = 1000.0
# The robot leaves torque mode after this many missed commands.
MISSED_COMMANDS = 20


class Springs:
    """One arm on springs; their stiffness and damping follow this node's dynamic parameters."""

    def __init__(self, side: str) -> None:
        self._limb = Limb(side)
        self._gains = {}
        # While the cuff is squeezed the robot ignores torques; here users must be able to hold the arm.
        self._cuff = rospy.Publisher("robot/limb/%s/suppress_cuff_interaction" % side, Empty, queue_size=1)
        self._server = ParameterServer(JointSpringsExampleConfig, self._on_gains)

    def hold(self, robot: EnabledRobot) -> None:
        """Pull the arm to neutral while `robot` is there. Raises ProgramFailed, RobotLost."""
        limb = self._limb
        expect(limb.move_to_neutral(), "the %s arm did not get to neutral" % limb.name)
        rest = limb.joint_angles()
        limb.set_command_timeout(MISSED_COMMANDS / RATE_HZ)
        print("the %s arm is on springs; Ctrl-C: quit" % limb.name, flush=True)
        try:
            for _ in robot.beats(RATE_HZ):
                self._cuff.publish()
                limb.set_joint_torques(spring_torques(rest, limb.joint_angles(), limb.joint_velocities(), *self._gains))
        finally:
            limb.exit_control_mode()

    def _on_gains(self, config, _level):
        self._gains = tuple(
            {"%s_%s" % (self._limb.name, joint): config[joint + suffix] for joint in JOINTS}
            for suffix in ("_spring_stiffness", "_damping_coefficient"))
        return config


def hold(side: str) -> None:
    with EnabledRobot() as robot:
        Springs(side).hold(robot)


def main() -> int:
    parser = new_parser(__doc__)
    add_limb(parser)
    side = parse(parser).limb
    return run("rsdk_joint_torque_springs_%s" % side, lambda: hold(side))


if __name__ == "__main__":
    sys.exit(main())
