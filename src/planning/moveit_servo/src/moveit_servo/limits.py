# SPDX-License-Identifier: BSD-3-Clause
"""Limits of the joints that are steered, and motions that keep them: velocity, acceleration, jerk, position."""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import ruckig

from moveit_servo.compiled import compiled

# Shares of the time to stop: in steps that pass before braking begins and on the way to the drives, and of the rest for
# building the deceleration up and down.
_SHARE_OF_LAG, _SHARE_OF_JERK = 0.2, 0.2
# Steps ahead at which a way is looked at; bounds that are broken by less do not matter [m/s].
_LOOKED_AT, _NO_MATTER = (1, 3, 6), 1e-3
_NO_GAPS = np.empty((0, 1))


class ServoLimits(NamedTuple):
    """lower, upper (k,) [rad or m], infinite where there is none; velocity, acceleration, jerk (k,) [per s, s^2, s^3].

    Every joint can stop from its velocity within the time that the limits were made for.
    """

    lower: np.ndarray
    upper: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    jerk: np.ndarray


def stoppable(lower: np.ndarray, upper: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray | None,
              stopping_time: float) -> ServoLimits:
    """Return ServoLimits with which every joint comes to rest within ``stopping_time`` [s].

    velocity, acceleration (k,): limits of the robot. Where the acceleration does not suffice, the velocity gets lower;
    acceleration None: what the velocity needs.
    """
    time = (1.0 - _SHARE_OF_LAG) * stopping_time
    braking = (1.0 - _SHARE_OF_JERK) * time
    most = velocity / braking if acceleration is None else acceleration
    velocity = np.minimum(velocity, most * braking)
    return ServoLimits(lower, upper, velocity, most, most / (_SHARE_OF_JERK * time))


@compiled
def speed_towards(room, limits, lag):
    """Return (k,) the greatest speed at which joints can still stop within ``room`` (k,) [rad], 0 where none is left.

    limits: ServoLimits. lag [s]: until braking begins.
    """
    speed = np.empty(len(room))
    for a in range(len(room)):
        acceleration = limits.acceleration[a]
        late = 0.5 * acceleration / limits.jerk[a] + lag
        left = max(room[a], 0.0)
        speed[a] = min(acceleration * (math.sqrt(late * late + 2.0 * left / acceleration) - late), limits.velocity[a])
    return speed


class ServoMotion:
    """Position, velocity and acceleration (k,) of the set-points, which never jump."""

    def __init__(self, position: np.ndarray, limits: ServoLimits) -> None:
        self.limits = limits
        self._solver = ruckig.Ruckig(len(position))
        self._input = ruckig.InputParameter(len(position))
        self._input.control_interface = ruckig.ControlInterface.Velocity
        self._input.max_velocity = limits.velocity.tolist()
        self._input.max_acceleration = limits.acceleration.tolist()
        self._input.max_jerk = limits.jerk.tolist()
        self._way = ruckig.Trajectory(len(position))
        self.rest_at(position)

    def rest_at(self, position: np.ndarray) -> None:
        """Begin again, at rest."""
        self.position = np.array(position, dtype=float)
        self.velocity, self.acceleration = np.zeros(len(position)), np.zeros(len(position))

    def follow(self, velocity: np.ndarray, seconds: float, together: bool, slope: np.ndarray = _NO_GAPS,
               least: np.ndarray = _NO_GAPS[:, 0]) -> None:
        """Move on for ``seconds`` towards ``velocity`` (k,).

        together: all joints change at the same time, which keeps the direction; otherwise each as fast as it can, as
        long as ``slope`` (m, k) @ velocity >= ``least`` (m,) on the way. A joint that brakes before another one, which
        it made up for, would break that. Raises ArithmeticError where ruckig finds no way; the motion stays as it is.
        """
        way = self._input
        way.current_position = self.position.tolist()
        way.current_velocity = self.velocity.tolist()
        way.current_acceleration = self.acceleration.tolist()
        way.target_velocity = velocity.tolist()
        way.target_acceleration = [0.0] * len(velocity)
        if together:
            self._calculate(ruckig.Synchronization.Time)
        else:
            self._calculate(ruckig.Synchronization.No)
            broken = self._broken(seconds, slope, least)
            if broken > _NO_MATTER:
                self._calculate(ruckig.Synchronization.Time)
                if self._broken(seconds, slope, least) >= broken:
                    self._calculate(ruckig.Synchronization.No)
        position, speed, acceleration = self._way.at_time(seconds)
        self.position, self.velocity = np.array(position), np.array(speed)
        self.acceleration = np.array(acceleration)

    def _calculate(self, synchronization: ruckig.Synchronization) -> None:
        self._input.synchronization = synchronization
        result = self._solver.calculate(self._input, self._way)
        if result not in (ruckig.Result.Working, ruckig.Result.Finished):
            raise ArithmeticError("no motion from %s to velocities %s: %s" % (
                self.velocity, self._input.target_velocity, result))

    def _broken(self, seconds: float, slope: np.ndarray, least: np.ndarray) -> float:
        """By how much a bound is broken on the way that was calculated, at most [m/s]."""
        if not len(least):
            return 0.0
        speeds = np.array([self._way.at_time(step * seconds)[1] for step in _LOOKED_AT])
        return float((least - speeds @ slope.T).max())
