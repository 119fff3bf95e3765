# SPDX-License-Identifier: BSD-3-Clause
"""Limits of the joints that are steered, and motions that keep them: velocity, acceleration, jerk, position."""
from __future__ import annotations

from typing import NamedTuple

import numpy as np
import ruckig

# Shares of the time to stop: in steps that pass before braking begins and on the way to the drives, and of the rest for
# building the deceleration up and down.
_SHARE_OF_LAG, _SHARE_OF_JERK = 0.2, 0.2


class JointLimits(NamedTuple):
    """lower, upper (k,) [rad or m], infinite where there is none; velocity, acceleration, jerk (k,) [per s, s^2, s^3].

    Every joint can stop from its velocity within the time that the limits were made for.
    """

    lower: np.ndarray
    upper: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    jerk: np.ndarray


def stoppable(lower: np.ndarray, upper: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray | None,
              stopping_time: float) -> JointLimits:
    """Return JointLimits with which every joint comes to rest within ``stopping_time`` [s].

    velocity, acceleration (k,): limits of the robot. Where the acceleration does not suffice, the velocity gets lower;
    acceleration None: what the velocity needs.
    """
    time = (1.0 - _SHARE_OF_LAG) * stopping_time
    braking = (1.0 - _SHARE_OF_JERK) * time
    if acceleration is None:
        acceleration = velocity / braking
    velocity = np.minimum(velocity, acceleration * braking)
    return JointLimits(lower, upper, velocity, acceleration, acceleration / (_SHARE_OF_JERK * time))


def speed_towards(room: np.ndarray, limits: JointLimits, lag: float) -> np.ndarray:
    """Return (k,) the greatest speed at which joints can still stop within ``room`` (k,) [rad], 0 where none is left.

    lag [s]: until braking begins.
    """
    acceleration = limits.acceleration
    late = 0.5 * acceleration / limits.jerk + lag
    room = np.maximum(room, 0.0)
    with np.errstate(invalid="ignore"):
        speed = acceleration * (np.sqrt(late * late + 2.0 * room / acceleration) - late)
    return np.minimum(np.where(np.isfinite(room), speed, np.inf), limits.velocity)


class Motion:
    """Position, velocity and acceleration (k,) of the set-points, which never jump."""

    def __init__(self, position: np.ndarray, limits: JointLimits) -> None:
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

    def follow(self, velocity: np.ndarray, seconds: float, together: bool) -> None:
        """Move on for ``seconds`` towards ``velocity`` (k,).

        together: all joints change at the same time, which keeps the direction; otherwise each as fast as it can.
        Raises ArithmeticError where ruckig finds no way; the motion stays as it is.
        """
        way = self._input
        way.current_position = self.position.tolist()
        way.current_velocity = self.velocity.tolist()
        way.current_acceleration = self.acceleration.tolist()
        way.target_velocity = velocity.tolist()
        way.target_acceleration = [0.0] * len(velocity)
        way.synchronization = ruckig.Synchronization.Time if together else ruckig.Synchronization.No
        result = self._solver.calculate(way, self._way)
        if result not in (ruckig.Result.Working, ruckig.Result.Finished):
            raise ArithmeticError("no motion from %s to velocities %s: %s" % (self.velocity, velocity, result))
        position, speed, acceleration = self._way.at_time(seconds)
        self.position, self.velocity = np.array(position), np.array(speed)
        self.acceleration = np.array(acceleration)
