# SPDX-License-Identifier: BSD-3-Clause
"""rospy's simulated time while somebody needs it. A simulator sends the clock up to 500 times a second, and a class has
many servers without a page."""
from __future__ import annotations

import threading
import time
from typing import TYPE_CHECKING

import rospy
from rosgraph_msgs.msg import Clock

from rospy_nodes.rest import Demand

if TYPE_CHECKING:
    from collections.abc import Callable

#: How long topics are still read when nobody needs them any more: a page that is loaded again finds all as it was [s].
LINGER_S = 10.0
# Who needs the time waits at most so long for the first message of the clock [s]; a paused simulator sends it at once.
_FIRST_S = 0.5


class SimClock:
    """For a node that was started with ``disable_rostime``. Its time stands still while ``is_needed()`` is false."""

    def __init__(self, is_needed: Callable[[], bool]) -> None:
        """Without the parameter use_sim_time, rospy's time is the wall's."""
        self._has_come, self._until = threading.Event(), 0.0
        self._rest: Callable[[], object] = lambda: None
        self._demand = Demand(self._listen, lambda: self._rest(), LINGER_S, is_needed)
        self._is_simulated = bool(rospy.get_param("/use_sim_time", False))
        if self._is_simulated:
            rospy.rostime._set_rostime(rospy.Time())

    def need(self) -> None:
        """Any thread: rospy's time is right when this returns, where there is a clock."""
        if self._is_simulated:
            self._demand.need()
            self._has_come.wait(max(0.0, self._until - time.monotonic()))

    def _listen(self) -> None:
        self._has_come.clear()
        self._rest = rospy.Subscriber("/clock", Clock, self._on_clock, queue_size=1, tcp_nodelay=True).unregister
        self._until = time.monotonic() + _FIRST_S

    def _on_clock(self, message: Clock) -> None:
        rospy.rostime._set_rostime(message.clock)
        self._has_come.set()
