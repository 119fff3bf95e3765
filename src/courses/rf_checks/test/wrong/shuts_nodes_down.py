# SPDX-License-Identifier: BSD-3-Clause
# exercise: tf_listener
"""Sends XML-RPC's `shutdown` to every node of the lab but the simulator."""
import xmlrpc.client

import rosgraph

master = rosgraph.Master("/student")
nodes = {node for part in master.getSystemState() for _, names in part for node in names}
for node in sorted(nodes - {"/gazebo"}):
    print(node, xmlrpc.client.ServerProxy(master.lookupNode(node)).shutdown("/student", "over"))
