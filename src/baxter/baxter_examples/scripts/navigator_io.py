#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Blink the lights of the left arm's navigator, or print what is pressed and turned on it."""
import sys

from baxter_dataflow.ros_clock import RosClock
from baxter_dataflow.waiting import Ticker
from baxter_examples.arguments import new_parser, parse
from baxter_interface import Navigator
from baxter_interface.programs import run

LOCATION = "left"
BLINKS, BLINK_RATE_HZ = 100, 10.0
READINGS, READING_RATE_HZ = 10, 1.0


def blink() -> None:
    navigator = Navigator(LOCATION)
    ticker = Ticker(RosClock(), BLINK_RATE_HZ)
    for turn in range(BLINKS):
        navigator.inner_led = turn % 2 == 0
        navigator.outer_led = turn % 2 == 1
        ticker.sleep()
    navigator.outer_led = False


def print_input() -> None:
    navigator = Navigator(LOCATION)
    ticker = Ticker(RosClock(), READING_RATE_HZ)
    for _ in range(READINGS):
        print("wheel %d, buttons %s" % (
            navigator.wheel, " ".join("down" if button else "up" for button in (
                navigator.button0, navigator.button1, navigator.button2))), flush=True)
        ticker.sleep()


def main() -> int:
    parser = new_parser(__doc__)
    action = parser.add_mutually_exclusive_group(required=True)
    action.add_argument("-b", "--blink", dest="body", action="store_const", const=blink, help="blink the lights")
    action.add_argument("-i", "--input", dest="body", action="store_const", const=print_input,
                        help="print wheel and buttons once a second")
    return run("rsdk_navigator_io", parse(parser).body, anonymous=True)


if __name__ == "__main__":
    sys.exit(main())
