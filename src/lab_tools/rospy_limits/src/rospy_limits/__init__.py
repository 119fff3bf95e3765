# SPDX-License-Identifier: BSD-3-Clause
"""Limits on what other programs can do to the ports of a rospy node.

rospy reads the handshake of each connection in the thread that accepts them all, without a time limit: one client
that connects and sends nothing keeps everybody else out. It keeps whatever a message announces in memory, and counts
nothing. :func:`rospy_limits.node.limit_ports` mends that for a node (docs/decisions/0009); the numbers are in
:mod:`rospy_limits.limits`.
"""
