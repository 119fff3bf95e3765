#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Publish a fragment of the robot's description, such as a tool in its hand, until Ctrl-C."""
import sys
import xml.etree.ElementTree as ElementTree

import rospy
from baxter_core_msgs.msg import URDFConfiguration

from baxter_dataflow.ros_clock import RosClock
from baxter_dataflow.waiting import Ticker
from baxter_examples.arguments import add_file, new_parser, parse
from baxter_interface.programs import ProgramFailed, run
from command_line.user_files import PIPE_WAIT_S, read_text

RATE_HZ = 5.0
# Of a fragment; a whole robot has less.
MAX_BYTES = 4_000_000


def send(path: str, link: str, joint: str) -> None:
    try:
        text = read_text(path, MAX_BYTES, pipe_wait_s=PIPE_WAIT_S)
        ElementTree.fromstring(text)
    except (OSError, UnicodeDecodeError) as error:
        raise ProgramFailed("%s cannot be read: %s" % (path, getattr(error, "strerror", error))) from error
    except ElementTree.ParseError as error:
        raise ProgramFailed("%s is not XML: %s" % (path, error)) from error
    publisher = rospy.Publisher("/robot/urdf", URDFConfiguration, queue_size=10)
    # For the robot, a new time means a new configuration, so the same message is sent repeatedly.
    message = URDFConfiguration(time=rospy.get_rostime(), link=link, joint=joint, urdf=text)
    print("sending %s as %s to link %s, until Ctrl-C" % (path, joint, link), flush=True)
    ticker = Ticker(RosClock(), RATE_HZ)
    while not rospy.is_shutdown():
        publisher.publish(message)
        ticker.sleep()


def main() -> int:
    parser = new_parser(__doc__)
    add_file(parser, "URDF fragment")
    parser.add_argument("-l", "--link", default="left_hand", help="link that it is fixed to (default: %(default)s)")
    parser.add_argument("-j", "--joint", default="left_gripper_base",
                        help="joint that fixes it (default: %(default)s)")
    arguments = parse(parser)
    return run("rsdk_configure_urdf", lambda: send(arguments.file, arguments.link, arguments.joint), anonymous=True)


if __name__ == "__main__":
    sys.exit(main())
