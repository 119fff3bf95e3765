# SPDX-License-Identifier: BSD-3-Clause
"""Limits of a commanded speed: velocity, acceleration and jerk. ROS-free."""
from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from controller_manager import ControllerError

if TYPE_CHECKING:
    from controller_manager import ControllerContext

_KINDS = ("velocity", "acceleration", "jerk")


@dataclass(frozen=True)
class SpeedLimits:
    """Bounds of one direction, (least, greatest) each: velocity [m/s or rad/s], acceleration, jerk; infinite where
    there is none."""

    velocity: tuple[float, float] = (-math.inf, math.inf)
    acceleration: tuple[float, float] = (-math.inf, math.inf)
    jerk: tuple[float, float] = (-math.inf, math.inf)

    def limit(self, wanted: float, last: float, before: float, dt: float) -> float:
        """The command ``wanted``, limited; ``last`` and ``before`` are the commands one and two ticks ago.

        Jerk is bounded first, then acceleration, then velocity; so the velocity limit always holds.
        """
        change, change_before = wanted - last, last - before
        low, high = (bound * dt * dt for bound in self.jerk)
        change = change_before + _clip(change - change_before, low, high)
        low, high = (bound * dt for bound in self.acceleration)
        change = _clip(change, low, high)
        return _clip(last + change, *self.velocity)


def _clip(value, low, high):
    return min(max(value, low), high)


def read_speed_limits(context: ControllerContext, direction: str) -> SpeedLimits:
    """The :class:`SpeedLimits` below a controller's parameter ``direction`` ("linear/x", "angular/z").

    ``has_velocity_limits``, ``max_velocity``, ``min_velocity`` (default the negative of the greatest), and the same for
    acceleration and jerk. Raises :class:`ControllerError`.
    """
    found = {}
    for kind in _KINDS:
        if not context.flag("%s/has_%s_limits" % (direction, kind), False):
            continue
        greatest = context.number("%s/max_%s" % (direction, kind), expected="the greatest %s in SI units" % kind)
        least = context.number("%s/min_%s" % (direction, kind), -greatest)
        if not least <= greatest:
            raise ControllerError("parameter %s is %g, expected at most max_%s, which is %g"
                                  % (context.resolve("%s/min_%s" % (direction, kind)), least, kind, greatest))
        found[kind] = (least, greatest)
    return SpeedLimits(**found)
