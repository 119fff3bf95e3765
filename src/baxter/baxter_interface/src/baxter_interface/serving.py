# SPDX-License-Identifier: BSD-3-Clause
"""Shared by the action servers' programs: serve until Ctrl-C, and detect a restart of the ROS master."""
from __future__ import annotations

import time
from typing import Any

import rosgraph
import rospy

from .programs import ProgramFailed

_CHECK_EVERY_S = 2.0


def serve(factories: Any, what: str) -> None:
    """Make the servers, one by each of `factories`, and let them serve until the node ends or is interrupted.

    Each server has `clean_shutdown()`, which is called while ROS still runs. `what` names them for the log.
    Raises the factories' errors, and ProgramFailed when the ROS master was restarted and no longer knows its nodes.
    """
    servers = []
    try:
        for make in factories:
            servers.append(make())
        rospy.loginfo("%s: ready, press Ctrl-C to stop", what)
        while not rospy.is_shutdown():
            time.sleep(_CHECK_EVERY_S)
            _require_known_to_master()
    finally:
        for server in servers:
            server.clean_shutdown()


def _require_known_to_master() -> None:
    if rospy.is_shutdown():
        return
    try:
        rosgraph.Master(rospy.get_name()).lookupNode(rospy.get_name())
    except rosgraph.MasterError as error:
        raise ProgramFailed("the ROS master at %s was restarted and does not know this program: start it again"
                            % rosgraph.get_master_uri()) from error
    except (OSError, rosgraph.MasterException):
        rospy.logwarn_throttle(60.0, "the ROS master at %s is gone; waiting for it" % rosgraph.get_master_uri())
