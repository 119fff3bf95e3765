# SPDX-License-Identifier: BSD-3-Clause
"""Options that several examples have."""
from __future__ import annotations

import argparse

import rospy

from baxter_external_devices.controls import CONTROLLERS
from baxter_model import SIDES


def new_parser(description: str | None) -> argparse.ArgumentParser:
    """Return an argparse parser with our `description` and the exit statuses."""
    return argparse.ArgumentParser(description=description,
                                   epilog="Exit status: 0 done, 1 failed, 2 wrong options, 130 after Ctrl-C.")


def add_limb(parser: argparse.ArgumentParser, text: str = "the arm") -> None:
    """Add -l/--limb, required."""
    parser.add_argument("-l", "--limb", required=True, choices=SIDES, help=text)


def add_joystick(parser: argparse.ArgumentParser) -> None:
    """Add -j/--joystick, required."""
    parser.add_argument("-j", "--joystick", required=True, choices=list(CONTROLLERS), help="the kind of joystick")


def add_file(parser: argparse.ArgumentParser, text: str) -> None:
    """Add -f/--file, required."""
    parser.add_argument("-f", "--file", required=True, metavar="PATH", help=text)


def add_component(parser: argparse.ArgumentParser, default: str) -> None:
    """Add -c/--component; see component()."""
    parser.add_argument("-c", "--component", default=default, help="channel's name (default: %(default)s); the "
                                                                   "parameter ~component_id overrides it")


def component(arguments: argparse.Namespace) -> str:
    """Return the channel that -c or the parameter ~component_id names; call it as an initialised node."""
    return str(rospy.get_param("~component_id", arguments.component))


def parse(parser: argparse.ArgumentParser) -> argparse.Namespace:
    """Parse the command line without ROS's remappings."""
    return parser.parse_args(rospy.myargv()[1:])
