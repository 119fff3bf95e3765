#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Test everything the robot has, one thing after the other; results also go to a file in the current folder."""
import argparse
import datetime
import sys
from collections.abc import Sequence
from typing import TextIO

import rospy

from baxter_interface import CHECK_VERSION, RobotEnable
from baxter_interface.programs import ProgramFailed, run
from baxter_interface.robot_enable import VERSION_PARAMETER
from baxter_tools.smoke_tests import TESTS, log_file_name

SERIAL_PARAMETER = "manifest/robot_serial"


def parse_arguments(argv: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="smoke_test.py", description=__doc__,
        epilog="The arms need room. Exit status: 0 all passed, 1 something failed, 2 wrong options.")
    parser.add_argument("-p", "--proceed", action="store_true", help="go on with the other tests after one has failed")
    parser.add_argument("-t", "--test", choices=list(TESTS), help="run this test only")
    return parser.parse_args(argv)


class Report:
    """Lines to the terminal and to the log file."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def say(self, text: str) -> None:
        print(text, flush=True)
        print(text, file=self._stream, flush=True)


def run_test(name: str, report: Report) -> bool:
    """Return whether the test passed; an exception means failure."""
    report.say("=== %s: %s" % (name, TESTS[name].__doc__))
    try:
        TESTS[name](report.say)
    except (OSError, ValueError, AttributeError, rospy.ROSException) as failure:
        if rospy.is_shutdown():
            raise
        report.say("--- %s: FAILED: %s" % (name, getattr(failure, "strerror", None) or failure))
        return False
    report.say("--- %s: passed" % name)
    return True


def run_tests(arguments: argparse.Namespace) -> None:
    robot = RobotEnable(CHECK_VERSION)
    was_enabled = robot.state().enabled
    serial = rospy.get_param(SERIAL_PARAMETER, None)
    if serial is None:
        raise ProgramFailed("the parameter %s is not set; a robot and the simulator's launch file set it"
                            % rospy.resolve_name(SERIAL_PARAMETER))
    version = rospy.get_param(VERSION_PARAMETER)
    if sys.stdin.isatty():
        input("The arms are going to move. Press <Enter> to begin ")
    names = [arguments.test] if arguments.test else list(TESTS)
    with open(log_file_name(str(serial), str(version), datetime.datetime.now()), "a", encoding="utf-8") as stream:
        report = Report(stream)
        report.say("smoke test of robot %s, software %s, %s" % (serial, version, datetime.datetime.now()))
        failed = []
        try:
            for name in names:
                if not run_test(name, report):
                    failed.append(name)
                    if not arguments.proceed:
                        break
        finally:
            if not was_enabled and robot.state().enabled:
                robot.disable()
        if failed:
            raise ProgramFailed("failed: %s" % ", ".join(failed))
        report.say("all passed: %s" % ", ".join(names))


def main() -> int:
    arguments = parse_arguments(rospy.myargv()[1:])
    return run("rsdk_smoke_test", lambda: run_tests(arguments))


if __name__ == "__main__":
    sys.exit(main())
