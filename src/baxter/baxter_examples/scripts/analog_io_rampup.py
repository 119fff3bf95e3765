#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Ramp an analog output up from 0 to 100 and down again."""
import sys

from baxter_dataflow.ros_clock import RosClock
from baxter_examples.arguments import add_component, component, new_parser, parse
from baxter_interface import AnalogIO
from baxter_interface.programs import run

LEVELS = (*range(0, 100, 10), *range(100, -1, -10))
PERIOD_S = 0.5


def ramp(name: str) -> None:
    output = AnalogIO(name)
    for level in LEVELS:
        print("%s: %d" % (name, level), flush=True)
        output.set_output(level)
        RosClock().sleep(PERIOD_S)


def main() -> int:
    parser = new_parser(__doc__)
    add_component(parser, "torso_fan")
    arguments = parse(parser)
    return run("rsdk_analog_io_rampup", lambda: ramp(component(arguments)), anonymous=True)


if __name__ == "__main__":
    sys.exit(main())
