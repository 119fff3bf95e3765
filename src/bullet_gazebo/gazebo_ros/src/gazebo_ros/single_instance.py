# SPDX-License-Identifier: BSD-3-Clause
"""One simulator per ROS master.

A node that registers under a name which is in use shuts the older one down. For a simulator that means a lab that dies
without a word, so a second one looks first and stays out.
"""
import xmlrpc.client

import rosgraph

_PING_TIMEOUT_S = 2.0


class _Transport(xmlrpc.client.Transport):
    def make_connection(self, host):
        connection = super().make_connection(host)
        connection.timeout = _PING_TIMEOUT_S
        return connection


def running_instance(node_name, caller_id="/gazebo_ros_look_up"):
    """(URI, process id) of a node that is registered as ``node_name`` and answers, or None.

    A registration that a dead node left behind does not count. Raises ``OSError`` when there is no master.
    """
    master = rosgraph.Master(caller_id)
    try:
        uri = master.lookupNode(node_name)
    except rosgraph.MasterError:
        return None
    try:
        code, _, pid = xmlrpc.client.ServerProxy(uri, transport=_Transport()).getPid(caller_id)
    except (OSError, xmlrpc.client.Error):
        return None
    return (uri, pid) if code == 1 else None


def refusal(node_name, uri, pid):
    """What to tell the user when an instance runs already."""
    return ("A simulator is running on this ROS master (%s): node %s, process %d, %s.\n"
            "This one does not start. To stop the other one: press Ctrl-C in its terminal, or\n"
            "    rosnode kill %s\n"
            "To run two side by side, give the second its own master (ROS_MASTER_URI=http://localhost:11312)."
            % (rosgraph.get_master_uri(), node_name, pid, uri, node_name))
