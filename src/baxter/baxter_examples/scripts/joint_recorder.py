#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Record both arms and grippers into a file, until Ctrl-C. The buttons at the cuffs open and close the grippers."""
import sys

from baxter_examples import JointRecorder
from baxter_examples.arguments import add_file, new_parser, parse
from baxter_examples.cuff_control import CuffControl
from baxter_interface.programs import EnabledRobot, run
from baxter_model import SIDES
from command_line.options import number


def record(path: str, rate_hz: float) -> None:
    with EnabledRobot() as robot:
        recorder = JointRecorder(path, rate_hz)
        cuffs = [CuffControl(side, lights=False, gripper=recorder.grippers.get(side)) for side in SIDES]

        def beats():
            for beat in robot.beats(rate_hz):
                for cuff in cuffs:
                    cuff.work()
                yield beat

        print("recording into %s until Ctrl-C" % path, flush=True)
        recorder.record(beats())


def main() -> int:
    parser = new_parser(__doc__)
    add_file(parser, "the recording to write")
    parser.add_argument("-r", "--rate", type=number(float, 0, 1000, above=True), default=100.0, metavar="HZ",
                        help="rows per second (default: %(default)g)")
    arguments = parse(parser)
    return run("rsdk_joint_recorder", lambda: record(arguments.file, arguments.rate))


if __name__ == "__main__":
    sys.exit(main())
