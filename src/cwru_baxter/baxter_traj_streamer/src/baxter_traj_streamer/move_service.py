# SPDX-License-Identifier: BSD-3-Clause
"""A node around one kind of move: a service that answers when the move is over."""
import threading

import rospy

import baxter_interface.startup

from .traj_client import MoveFailed, TrajClient

# What a request may ask for that cannot be (PlayfileError, SettingsError, LeavesReach are ValueErrors).
REFUSALS = (MoveFailed, ValueError, OSError)


def run(name, service, service_type, move_type, plan):
    """Be the node ``name`` until it is shut down. ``plan(move, request)`` gives the trajectory for a request.

    A request that comes while another is at work is refused; trajActionServer/cancel stops the latter.
    """
    baxter_interface.startup.init_node(name)
    client = TrajClient()
    client.wait_until_ready()
    move = move_type(client)
    busy = threading.Lock()
    answer_type = service_type._response_class

    def answer(request):
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
