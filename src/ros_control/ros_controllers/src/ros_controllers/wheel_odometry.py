# SPDX-License-Identifier: BSD-3-Clause
"""Pose of a vehicle from the rotation of its wheels. ROS-free."""
from __future__ import annotations

import math
from collections import deque

# A smaller turn [rad] in a tick counts as straight: the arc's radius would be lost in rounding.
_STRAIGHT_RAD = 1e-6


class WheelOdometry:
    """Pose (x, y [m], heading [rad]) since the start, and speeds (linear, lateral [m/s], angular [rad/s]), means over a
    window.

    Attributes: ``x``, ``y``, ``heading``, ``linear``, ``lateral``, ``angular``.
    """

    def __init__(self, window: int = 10) -> None:
        """``window``: number of ticks in the average of the speeds."""
        self.x = self.y = self.heading = 0.0
        self._linears, self._laterals, self._angulars = (deque(maxlen=window) for _ in range(3))
        self.rest()

    def rest(self) -> None:
        """The vehicle rests."""
        self.linear = self.lateral = self.angular = 0.0
        for speeds in (self._linears, self._laterals, self._angulars):
            speeds.clear()

    def move(self, distance: float, turn: float, dt: float, sideways: float = 0.0) -> None:
        """The vehicle has gone ``distance`` [m] forwards and ``sideways`` [m] to its left while it turned by ``turn``
        [rad], in ``dt`` [s].

        The path is the arc of a circle, whose chord this adds exactly.
        """
        if abs(turn) < _STRAIGHT_RAD:
            middle = self.heading + turn / 2.0
            along, across = math.cos(middle), math.sin(middle)
        else:
            after = self.heading + turn
            along = (math.sin(after) - math.sin(self.heading)) / turn
            across = (math.cos(self.heading) - math.cos(after)) / turn
        self.x += distance * along - sideways * across
        self.y += distance * across + sideways * along
        self.heading += turn
        self._linears.append(distance / dt)
        self._laterals.append(sideways / dt)
        self._angulars.append(turn / dt)
        self.linear = sum(self._linears) / len(self._linears)
        self.lateral = sum(self._laterals) / len(self._laterals)
        self.angular = sum(self._angulars) / len(self._angulars)
