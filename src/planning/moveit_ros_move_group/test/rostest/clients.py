# SPDX-License-Identifier: BSD-3-Clause
"""Clients of move_group, which is there when they are returned."""
import actionlib
import rospy

from lab_testing.waiting import stretched

TIMEOUT_S = stretched(60.0)


def action(name, kind):
    """Return the SimpleActionClient of one of move_group's actions."""
    client = actionlib.SimpleActionClient(name, kind)
    assert client.wait_for_server(rospy.Duration(TIMEOUT_S)), "move_group does not serve %s" % name
    return client


def services(**kinds):
    """Return {name: ServiceProxy} of services by their types."""
    for name in kinds:
        rospy.wait_for_service(name, TIMEOUT_S)
    return {name: rospy.ServiceProxy(name, kind) for name, kind in kinds.items()}
