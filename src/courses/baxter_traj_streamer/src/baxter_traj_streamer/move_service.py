# SPDX-License-Identifier: BSD-3-Clause
"""A node for one kind of move: a service that responds when the move is over."""
from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import rospy

import baxter_interface.startup

from .traj_client import MoveFailed, TrajClient

if TYPE_CHECKING:
    from trajectory_msgs.msg import JointTrajectory

# Errors of invalid requests (PlayfileError, SettingsError, LeavesReach are ValueErrors).
REFUSALS = (MoveFailed, ValueError, OSError)


def run(name: str, service: str, service_type: type, move_type: Callable[[TrajClient], Any],
        plan: Callable[[Any, Any], JointTrajectory]) -> None:
    """Run as the node ``name`` until it is shut down. ``plan(move, request)`` returns the trajectory for a request.

    A request during another one is refused; trajActionServer/cancel stops the active one.
    """
    baxter_interface.startup.init_node(name)
    client = TrajClient()
    client.wait_until_ready()
    move = move_type(client)
    busy = threading.Lock()
    answer_type = service_type._response_class

    def answer(request: Any):
        if not busy.acquire(blocking=False):
            return answer_type(success=False, message="another move is under way; trajActionServer/cancel stops it")
        try:
            client.move(plan(move, request))
        except REFUSALS as error:
            rospy.logwarn("%s: %s", service, error)
            return answer_type(success=False, message=str(error))
        finally:
            busy.release()
        return answer_type(success=True, message="there")

    server = rospy.Service(service, service_type, answer)
    rospy.loginfo("%s is ready", server.resolved_name)
    rospy.spin()
