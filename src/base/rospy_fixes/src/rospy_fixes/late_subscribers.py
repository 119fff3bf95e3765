# SPDX-License-Identifier: BSD-3-Clause
"""Lets a program's shutdown handlers reach subscribers that connect only then.

rospy refuses subscribers from the moment at which a node begins to shut down, but runs the shutdown handlers after
that. A program that ends soon after its start was not connected yet: what its handler published was lost, and a handler
that publishes until it sees the effect never ended.
"""
from __future__ import annotations

import functools
import threading
from typing import Any

import rospy.core


def amend(tcpros_pubsub: Any) -> None:
    """Make the publishers of rospy.impl.tcpros_pubsub accept subscribers until the shutdown handlers have run."""
    connecting = threading.local()
    requested = rospy.core.is_shutdown_requested
    take = tcpros_pubsub.TCPROSHandler.topic_connection_handler

    def is_shutdown_requested():
        # rospy empties the list of handlers when they have run.
        if getattr(connecting, "now", False) and rospy.core._client_shutdown_hooks:
            return False
        return requested()

    @functools.wraps(take)
    def topic_connection_handler(self, *arguments):
        connecting.now = True
        try:
            return take(self, *arguments)
        finally:
            connecting.now = False

    rospy.core.is_shutdown_requested = functools.wraps(requested)(is_shutdown_requested)
    tcpros_pubsub.TCPROSHandler.topic_connection_handler = topic_connection_handler
