#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Teach an arm waypoints by hand, and have it go through them; buttons of its navigator record and play."""
import argparse
import sys

from baxter_examples.arguments import add_limb, new_parser, parse
from baxter_interface import JOINT_ANGLE_TOLERANCE, Limb, Navigator
from baxter_interface.programs import EnabledRobot, run
from command_line.options import counted, number

RATE_HZ = 20.0
PROMPT = "press the wheel to record a waypoint (%d so far), the button below it to play them; Ctrl-C: quit"


class Waypoints:
    """Waypoints of one arm, recorded and played by the buttons of its navigator."""

    def __init__(self, side: str, speed: float, accuracy_rad: float) -> None:
        self._limb = Limb(side)
        self._speed, self._accuracy_rad = speed, accuracy_rad
        self._waypoints = []
        self._playing = False
        self._navigator = Navigator(side)
        self._navigator.button0_changed.connect(self._on_record)
        self._navigator.button2_changed.connect(self._on_play)

    def work(self, robot: EnabledRobot) -> None:
        """Record until there is something to play, play until `robot` is gone. Raises RobotLost."""
        print(PROMPT % 0, flush=True)
        for _ in robot.beats(RATE_HZ):
            if self._playing:
                break
        self._limb.set_joint_position_speed(self._speed)
        while self._playing:
            print("playing %s" % counted(len(self._waypoints), "waypoint"), flush=True)
            for waypoint in self._waypoints:
                # A failed move has logged why; the beat detects a lost robot.
                self._limb.move_to_joint_positions(waypoint, threshold=self._accuracy_rad)
                if next(robot.beats(RATE_HZ), self) is self:
                    return
            if not robot.is_enabled():
                for _ in robot.beats(RATE_HZ):
                    pass

    def _on_record(self, pressed):
        if pressed and not self._playing:
            self._waypoints.append(self._limb.joint_angles())
            print(PROMPT % len(self._waypoints), flush=True)

    def _on_play(self, pressed):
        if pressed and not self._playing:
            if self._waypoints:
                self._playing = True
            else:
                print("there is no waypoint to play yet", flush=True)


def teach(arguments: argparse.Namespace) -> None:
    with EnabledRobot() as robot:
        Waypoints(arguments.limb, arguments.speed, arguments.accuracy).work(robot)


def main() -> int:
    parser = new_parser(__doc__)
    add_limb(parser)
    parser.add_argument("-s", "--speed", type=number(float, 0, 100), default=0.3,
                        help="speed ratio, 0 to 1 (default: %(default)s)")
    parser.add_argument("-a", "--accuracy", type=number(float, 0, 100, above=True), default=JOINT_ANGLE_TOLERANCE,
                        help="error of each joint below which a waypoint is reached [rad] (default: %(default)s)")
    arguments = parse(parser)
    return run("rsdk_joint_position_waypoints_%s" % arguments.limb, lambda: teach(arguments))


if __name__ == "__main__":
    sys.exit(main())
