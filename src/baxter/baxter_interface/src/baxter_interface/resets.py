# SPDX-License-Identifier: BSD-3-Clause
"""Count resets of the simulation, which move the robot: commands from before a reset are invalid."""
from __future__ import annotations

from collections.abc import Callable
from typing import Any

import rospy
from std_msgs.msg import UInt32

PUT_ELSEWHERE = "the robot was put elsewhere: the simulation was reset, or its joints were set"


class Resets:
    """Counts the resets of a simulated robot; a physical one has no such topic, and counts 0.

    on_reset: function that is called each time, in a thread of rospy's.
    """

    def __init__(self, on_reset: Callable[[], object] = lambda: None) -> None:
        #: How often so far.
        self.count = 0
        self._on_reset = on_reset
        self._last = None
        self._subscriber = rospy.Subscriber("robot/sim/resets", UInt32, self._on_number, queue_size=10)

    def unregister(self) -> None:
        """Unsubscribe."""
        self._subscriber.unregister()

    def _on_number(self, message: Any) -> None:
        # Latched: the first message only gives the start of the count, and a new connection repeats the last one.
        before, self._last = self._last, message.data
        if before not in (None, message.data):
            self.count += 1
            self._on_reset()
