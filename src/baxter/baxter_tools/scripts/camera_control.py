#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Open, close and list the robot's cameras, or search for them again."""
import argparse
import sys
from collections.abc import Sequence

import rospy
from std_srvs.srv import Empty

from baxter_interface import CameraController
from baxter_interface.camera import list_cameras
from baxter_interface.camera_settings import MODES
from baxter_interface.programs import run
from baxter_interface.services import call_service


def resolution(text: str) -> tuple[int, int]:
    try:
        width, height = (int(part) for part in text.lower().split("x"))
    except ValueError:
        width = height = 0
    if (width, height) not in MODES:
        raise argparse.ArgumentTypeError("%r is not a resolution; choose from %s" % (text, _modes()))
    return width, height


def _modes():
    return ", ".join("%dx%d" % mode for mode in MODES)


def parse_arguments(argv: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="camera_control.py", description=__doc__,
        epilog="Exit status: 0 done, 1 failed, 2 wrong options.")
    action = parser.add_mutually_exclusive_group(required=True)
    action.add_argument("-o", "--open", metavar="CAMERA", help="open this camera")
    action.add_argument("-c", "--close", metavar="CAMERA", help="close this camera")
    action.add_argument("-l", "--list", action="store_true", help="list the cameras with power, and which are open")
    action.add_argument("-e", "--enumerate", action="store_true", help="let the robot look for its cameras again")
    parser.add_argument("-r", "--resolution", type=resolution, default=MODES[0], metavar="WxH",
                        help="resolution to open with: %s (default: %%(default)s)" % _modes())
    return parser.parse_args(argv)


def print_cameras() -> None:
    published = {name for name, _type in rospy.get_published_topics()}
    for camera in list_cameras():
        print(camera + (" - (open)" if "/cameras/%s/image" % camera in published else ""))


def do(arguments: argparse.Namespace) -> None:
    if arguments.list:
        print_cameras()
    elif arguments.enumerate:
        call_service("/cameras/reset", Empty)
    elif arguments.close:
        CameraController(arguments.close).close()
    else:
        # Assigning the resolution opens the camera.
        CameraController(arguments.open).resolution = arguments.resolution


def main() -> int:
    arguments = parse_arguments(rospy.myargv()[1:])
    return run("rsdk_camera_control", lambda: do(arguments), anonymous=True)


if __name__ == "__main__":
    sys.exit(main())
