#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Send an arm along a trajectory through its action server."""
import sys

from baxter_examples.arguments import add_limb, new_parser, parse
from baxter_examples.trajectories import TrajectoryClient
from baxter_interface import Limb
from baxter_interface.programs import EnabledRobot, run
from baxter_model import JOINTS, arm_angles

# From shoulder to wrist [rad], on the left arm; the right one mirrors it.
POSTURE = (-0.11, -0.62, -1.15, 1.32, 0.80, 1.27, 2.39)
# Time [s] and factor of POSTURE.
POINTS = ((7.0, 1.0), (9.0, 0.75), (12.0, 1.25))
PATIENCE_S = 15.0


def move(side: str) -> None:
    client = TrajectoryClient(side)
    with EnabledRobot():
        limb = Limb(side)
        posture = list(arm_angles(side, dict(zip(JOINTS, POSTURE, strict=True))).values())
        here = limb.joint_angles()
        client.add(0.0, [here[name] for name in limb.joint_names()])
        for time_s, factor in POINTS:
            client.add(time_s, [factor * angle for angle in posture])
        client.send()
        client.wait(PATIENCE_S)
        print("the %s arm has followed its trajectory" % side, flush=True)


def main() -> int:
    parser = new_parser(__doc__)
    add_limb(parser)
    side = parse(parser).limb
    return run("rsdk_joint_trajectory_client_%s" % side, lambda: move(side))


if __name__ == "__main__":
    sys.exit(main())
