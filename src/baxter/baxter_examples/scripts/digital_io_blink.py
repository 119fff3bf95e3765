#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Switch a digital output on and off."""
import sys

from baxter_dataflow.ros_clock import RosClock
from baxter_examples.arguments import add_component, component, new_parser, parse
from baxter_interface import DigitalIO
from baxter_interface.programs import run

PERIOD_S = 1.0


def blink(name: str) -> None:
    output = DigitalIO(name)
    print("%s: %s at first" % (name, output.state), flush=True)
    for value in (True, False):
        output.set_output(value)
        print("%s: %s" % (name, output.state), flush=True)
        RosClock().sleep(PERIOD_S)


def main() -> int:
    parser = new_parser(__doc__)
    add_component(parser, "left_outer_light")
    arguments = parse(parser)
    return run("rsdk_digital_io_blink", lambda: blink(component(arguments)), anonymous=True)


if __name__ == "__main__":
    sys.exit(main())
