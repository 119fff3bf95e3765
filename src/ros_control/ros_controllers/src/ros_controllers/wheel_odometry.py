# SPDX-License-Identifier: BSD-3-Clause
"""Pose of a vehicle from the rotation of its wheels. ROS-free."""
import math
from collections import deque

# A smaller turn [rad] in a tick counts as straight: the arc's radius would be lost in rounding.
_STRAIGHT_RAD = 1e-6


class WheelOdometry:
    """Pose (x, y [m], heading [rad]) since the start, and speeds (linear [m/s], angular [rad/s]), means over a window.

    Attributes: ``x``, ``y``, ``heading``, ``linear``, ``angular``.
    """

    def __init__(self, window=10):
        """``window``: number of ticks in the average of the speeds."""
        self.x = self.y = self.heading = 0.0
        self._linears, self._angulars = deque(maxlen=window), deque(maxlen=window)
        self.rest()

    def rest(self):
        """The vehicle rests."""
        self.linear = self.angular = 0.0
        self._linears.clear()
        self._angulars.clear()

    def move(self, distance, turn, dt):
        """The vehicle has gone ``distance`` [m] along its path while it turned by ``turn`` [rad], in ``dt`` [s].

        The path is the arc of a circle, whose chord this adds exactly.
        """
        if abs(turn) < _STRAIGHT_RAD:
            middle = self.heading + turn / 2.0
            self.x += distance * math.cos(middle)
            self.y += distance * math.sin(middle)
        else:
            radius, after = distance / turn, self.heading + turn
            self.x += radius * (math.sin(after) - math.sin(self.heading))
            self.y += radius * (math.cos(self.heading) - math.cos(after))
        self.heading += turn
        self._linears.append(distance / dt)
        self._angulars.append(turn / dt)
        self.linear = sum(self._linears) / len(self._linears)
        self.angular = sum(self._angulars) / len(self._angulars)
