# SPDX-License-Identifier: BSD-3-Clause
"""Limits on what other programs can do to the ports of a rospy node.

rospy reads the handshake of each connection in the thread that accepts them all, without a time limit: one client that
connects and sends nothing blocks everybody else. It reserves memory of any announced size, and counts no connections.
``rospy_nodes.start.limit_ports`` fixes this for a node (docs/decisions/0009); the numbers are in
:mod:`rospy_fixes.ports.limits`.
"""
