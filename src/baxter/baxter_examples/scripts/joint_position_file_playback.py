#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Play a recording of joint_recorder.py back, in position mode."""
import sys

from baxter_dataflow.ros_clock import RosClock
from baxter_dataflow.waiting import Stopwatch
from baxter_examples import recording
from baxter_examples.arguments import add_file, new_parser, parse
from baxter_examples.mounted_grippers import mounted_grippers
from baxter_interface import Limb
from baxter_interface.programs import EnabledRobot, expect, run
from baxter_model import SIDES

RATE_HZ = 1000.0
# Smallest change that is sent to a gripper [%].
GRIPPER_STEP_PERCENT = 1.0


class PositionPlayer:
    """Sends a recording's values to its arms and grippers."""

    def __init__(self, record: recording.Recording) -> None:
        self._parts = []
        grippers = mounted_grippers([side for side in SIDES if record.side(side)[1]], calibrate=True)
        for side in SIDES:
            joints, _ = record.side(side)
            self._parts.append((Limb(side) if joints else None, joints, grippers.get(side), side + "_gripper"))
        self._sent = {}

    def go_to(self, row: dict[str, float]) -> None:
        """Move the arms to `row` gently."""
        for limb, joints, _, _ in self._parts:
            if limb:
                expect(limb.move_to_joint_positions({name: row[name] for name in joints}),
                       "the %s arm did not get to the recording's start" % limb.name)

    def command(self, row: dict[str, float]) -> None:
        for limb, joints, gripper, column in self._parts:
            if limb:
                limb.set_joint_positions({name: row[name] for name in joints})
            if gripper and abs(self._sent.get(column, float("inf")) - row[column]) > GRIPPER_STEP_PERCENT:
                gripper.command_position(row[column])
                self._sent[column] = row[column]


def play(path: str, loops: int) -> None:
    record = recording.read(path)
    with EnabledRobot() as robot:
        player = PositionPlayer(record)
        done = 0
        while loops < 1 or done < loops:
            done += 1
            print("moving to the start of %s" % path, flush=True)
            player.go_to(record.rows[0])
            print("playing, time %d%s" % (done, " of %d" % loops if loops >= 1 else ""), flush=True)
            clock = RosClock()
            watch = Stopwatch(clock.now())
            begin_s = record.times_s[0]
            for _ in robot.beats(RATE_HZ):
                time_s = begin_s + watch.elapsed_s(clock.now())
                player.command(record.at(time_s))
                if time_s >= record.duration_s:
                    break
            else:
                return


def main() -> int:
    parser = new_parser(__doc__)
    add_file(parser, "the recording")
    parser.add_argument("-l", "--loops", type=int, default=1, help="repetitions, below 1: endless (%(default)d)")
    arguments = parse(parser)
    return run("rsdk_joint_position_file_playback", lambda: play(arguments.file, arguments.loops))


if __name__ == "__main__":
    sys.exit(main())
