# SPDX-License-Identifier: BSD-3-Clause
"""Shared by the commands that move arms."""
from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING

import rospy

import baxter_interface.startup
from command_line.options import MAX_SECONDS, number

from .move_service import REFUSALS
from .traj_client import MoveFailed, TrajClient

if TYPE_CHECKING:
    from trajectory_msgs.msg import JointTrajectory


def add_wait_option(parser: argparse.ArgumentParser, default_s: float | None) -> None:
    """``--wait SECONDS``; ``default_s`` None: until the move is over."""
    parser.add_argument("--wait", type=number(float, 0, MAX_SECONDS), default=default_s, metavar="SECONDS",
                        help="how long to wait for the result, in the robot's time; the arm moves on in any case "
                             "(default: %s)"
                        % ("until it is there" if default_s is None else "%g" % default_s))


def run(name: str, plan: Callable[[TrajClient], JointTrajectory | None], wait_s: float | None) -> None:
    """Send the trajectory ``plan(client)`` and wait for it; exits with a line on stderr after a failure.

    ``plan`` returns None if there is nothing to send.
    """
    what_now = "nothing was sent"
    try:
        baxter_interface.startup.init_node(name, anonymous=True)
        client = TrajClient()
        client.wait_until_ready()
        trajectory = plan(client)
        if trajectory is None:
            return
        what_now = ("trajActionServer stops the arm" if client.streamer.settings.stop_when_client_leaves else
                    "the arm moves on (trajActionServer/cancel stops it)")
        result = client.move(trajectory, wait_s)
        if result is None:
            rospy.logwarn("no result within %g s; the arm moves on", wait_s)
        else:
            rospy.loginfo("the arm is there (return_val %d)", result.return_val)
    except MoveFailed as error:
        sys.exit(str(error))
    except REFUSALS as error:
        sys.exit("%s: %s" % (name, error))
    except (KeyboardInterrupt, rospy.ROSInterruptException):
        print("%s: interrupted; %s" % (name, what_now), file=sys.stderr)
        sys.exit(130)
