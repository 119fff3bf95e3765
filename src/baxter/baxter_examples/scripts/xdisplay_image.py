#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Show a picture on the robot's screen (1024x600; smaller ones at its left upper corner)."""
import pathlib
import sys

import cv2
import cv_bridge
import numpy as np
import rospy
from sensor_msgs.msg import Image

from baxter_dataflow.ros_clock import RosClock
from baxter_examples.arguments import add_file, new_parser, parse
from baxter_interface import startup
from baxter_interface.programs import ProgramFailed, run
from command_line.options import MAX_SECONDS, number
from command_line.user_files import PIPE_WAIT_S, check_picture, read_file

# A latched picture disappears with its publisher: time for new subscribers to receive it [s].
HAND_OVER_S = 1.0
# Of a picture; the screen has 614,400 pixels.
MAX_BYTES, MAX_PIXELS = 100_000_000, 64_000_000


def show(path: pathlib.Path, delay_s: float) -> None:
    try:
        content = read_file(path, MAX_BYTES, pipe_wait_s=PIPE_WAIT_S)
        check_picture(content, MAX_PIXELS)
    except OSError as error:
        raise ProgramFailed("%s: %s" % (path, error.strerror)) from error
    picture = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_COLOR)
    if picture is None:
        raise ProgramFailed("%s: this is not a picture that OpenCV reads" % path)
    publisher = rospy.Publisher("/robot/xdisplay", Image, latch=True, queue_size=1)
    RosClock().sleep(delay_s)
    startup.wait_for_subscribers(publisher)
    publisher.publish(cv_bridge.CvBridge().cv2_to_imgmsg(picture, encoding="bgr8"))
    RosClock().sleep(HAND_OVER_S)


def main() -> int:
    parser = new_parser(__doc__)
    add_file(parser, "the picture's file")
    parser.add_argument("-d", "--delay", type=number(float, 0, MAX_SECONDS), default=0.0, metavar="SECONDS",
                        help="wait before (default: 0)")
    arguments = parse(parser)
    return run("rsdk_xdisplay_image", lambda: show(pathlib.Path(arguments.file), arguments.delay), anonymous=True)


if __name__ == "__main__":
    sys.exit(main())
