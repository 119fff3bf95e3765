# SPDX-License-Identifier: BSD-3-Clause
"""Velocity and acceleration limits of a link on lines and arcs."""
from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class CartesianLimits:
    """trans_velocity [m/s], trans_acceleration, trans_deceleration [m/s^2], rot_velocity [rad/s]; all above 0.

    The values are those of MoveIt's setup assistant.
    """

    trans_velocity: float = 1.0
    trans_acceleration: float = 2.25
    trans_deceleration: float = 5.0
    rot_velocity: float = 1.57

    @classmethod
    def from_mapping(cls, mapping: object) -> tuple[CartesianLimits, list[str]]:
        """Return (limits of a cartesian_limits.yaml's mapping, list of complaints); its deceleration is negative."""
        found, complaints = {}, []
        mapping = mapping if isinstance(mapping, dict) else {}
        for key, name in (("max_trans_vel", "trans_velocity"), ("max_trans_acc", "trans_acceleration"),
                          ("max_trans_dec", "trans_deceleration"), ("max_rot_vel", "rot_velocity")):
            value = mapping.get(key)
            number = abs(value) if isinstance(value, int | float) and not isinstance(value, bool) else math.nan
            if math.isfinite(number) and number > 0.0:
                found[name] = float(number)
            else:
                complaints.append("cartesian_limits/%s is %r, expected a number other than 0; lines and arcs are "
                                  "planned with %g" % (key, value, getattr(cls, name)))
        return cls(**found), complaints

    def along(self, length: float, angle: float, scaling: tuple[float, float]) -> tuple[float, float, float]:
        """Return (velocity, acceleration, deceleration) of the fraction of a path of ``length`` [m] and ``angle``
        [rad].

        scaling: (of velocity, of acceleration). The ratio of rotational acceleration to velocity is that of the
        translations.
        """
        way = max(length / self.trans_velocity, angle / self.rot_velocity)  # its duration at full speed [s]
        full = self.trans_velocity
        return (scaling[0] / way, scaling[1] * self.trans_acceleration / full / way,
                scaling[1] * self.trans_deceleration / full / way)
