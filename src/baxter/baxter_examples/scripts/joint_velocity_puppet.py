#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Move one arm by hand, and have the other one mirror it."""
import argparse
import sys

from baxter_examples.arguments import add_limb, new_parser, parse
from baxter_interface import Limb
from baxter_interface.programs import EnabledRobot, expect, run
from baxter_model import JOINTS, mirrored, named, other_side

RATE_HZ = 100.0
AMPLIFICATION_RANGE = (0.1, 3.0)


def amplification(text: str) -> float:
    lowest, highest = AMPLIFICATION_RANGE
    if not lowest <= float(text) <= highest:
        raise argparse.ArgumentTypeError("must be from %g to %g, got %s" % (lowest, highest, text))
    return float(text)


def mirror(side: str, factor: float) -> None:
    with EnabledRobot() as robot:
        hand, puppet = Limb(side), Limb(other_side(side))
        for limb in (hand, puppet):
            expect(limb.move_to_neutral(), "the %s arm did not get to neutral" % limb.name)
        print("squeeze the %s cuff and move that arm; Ctrl-C: quit" % side, flush=True)
        try:
            for _ in robot.beats(RATE_HZ):
                speeds = hand.joint_velocities()
                mirrored_speeds = mirrored({joint: factor * speeds["%s_%s" % (side, joint)] for joint in JOINTS})
                puppet.set_joint_velocities(named(puppet.name, mirrored_speeds))
        finally:
            puppet.exit_control_mode()


def main() -> int:
    parser = new_parser(__doc__)
    add_limb(parser, "the arm that is moved by hand")
    parser.add_argument("-a", "--amplification", type=amplification, default=1.0,
                        help="how much faster the other arm is, %g to %g (default: 1)" % AMPLIFICATION_RANGE)
    arguments = parse(parser)
    return run("rsdk_joint_velocity_puppet", lambda: mirror(arguments.limb, arguments.amplification))


if __name__ == "__main__":
    sys.exit(main())
