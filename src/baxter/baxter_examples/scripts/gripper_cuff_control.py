#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Open and close grippers with the buttons at the cuffs; squeezing a cuff lights the arm's navigator."""
import sys
from collections.abc import Callable, Sequence

from baxter_examples.arguments import new_parser, parse
from baxter_examples.cuff_control import CuffControl
from baxter_interface.programs import EnabledRobot, run
from baxter_model import SIDES

RATE_HZ = 10.0


def control(sides: Sequence[str], lights: bool, say: Callable[[str], object]) -> None:
    with EnabledRobot() as robot:
        controls = [CuffControl(side, lights, say) for side in sides]
        print("round button: open, dash button: close; Ctrl-C: quit", flush=True)
        for _ in robot.beats(RATE_HZ):
            for cuff in controls:
                cuff.work()


def main() -> int:
    parser = new_parser(__doc__)
    parser.add_argument("-g", "--gripper", choices=("both", *SIDES), default="both",
                        help="the gripper (default: %(default)s)")
    parser.add_argument("-n", "--no-lights", dest="lights", action="store_false", help="leave the lights alone")
    parser.add_argument("-v", "--verbose", action="store_true", help="say what is pressed")
    arguments = parse(parser)
    sides = SIDES if arguments.gripper == "both" else (arguments.gripper,)
    say = (lambda text: print(text, flush=True)) if arguments.verbose else (lambda text: None)
    return run("rsdk_gripper_cuff_control_%s" % arguments.gripper, lambda: control(sides, arguments.lights, say))


if __name__ == "__main__":
    sys.exit(main())
