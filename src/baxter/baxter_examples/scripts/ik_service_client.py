#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Ask the robot for joint angles that put a hand at a given pose."""
import sys

from baxter_examples.arguments import add_limb, new_parser, parse
from baxter_interface import Limb
from baxter_interface.programs import run

# Position [m] and quaternion x y z w in base, for each arm.
POSES = {
    "left": ((0.657579481614, 0.851981417433, 0.0388352386502),
             (-0.366894936773, 0.885980397775, 0.108155782462, 0.262162481772)),
    "right": ((0.656982770038, -0.852598021641, 0.0388609422173),
              (0.367048116303, 0.885911751787, -0.108908281936, 0.261868353356)),
}


def print_solution(limb: str) -> None:
    for name, angle in sorted(Limb(limb).ik(POSES[limb]).items()):
        print("%s: %.6f" % (name, angle), flush=True)


def main() -> int:
    parser = new_parser(__doc__)
    add_limb(parser)
    limb = parse(parser).limb
    return run("rsdk_ik_service_client", lambda: print_solution(limb))


if __name__ == "__main__":
    sys.exit(main())
