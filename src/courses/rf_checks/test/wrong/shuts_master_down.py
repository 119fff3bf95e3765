# SPDX-License-Identifier: BSD-3-Clause
# exercise: tf_listener
"""Sends XML-RPC's `shutdown` to the ROS master."""
import xmlrpc.client

import rosgraph

print(xmlrpc.client.ServerProxy(rosgraph.get_master_uri()).shutdown("/student", "over"))
