# SPDX-License-Identifier: BSD-3-Clause
"""The head: it pans, and it nods."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from baxter_model import HEAD_JOINT

from .arms.setpoint import approach
from .errors import CommandRefused

if TYPE_CHECKING:
    from bullet_sim import Model

FULL_SPEED = 8.4  # [rad/s] at speed ratio 1: the physical robot's
ACCELERATION = 30.0  # [rad/s^2] of the set-point; the joint follows that without overshooting
NOD_S = 1.0  # the screen's way down and up again
TURNING_SPEED = 0.01  # [rad/s] from which the head counts as turning


class HeadHardware:
    """Set-point of the pan joint, and the clock of a nod.

    lower, upper: limits of the joint [rad]; pan: where it is now [rad]; dt: length of a tick [s]; dead_band: so far
    from its target it stops [rad], and it does not start for less.
    """

    def __init__(self, lower: float, upper: float, pan: float, dt: float = 0.002, dead_band: float = 0.0) -> None:
        self._lower, self._upper, self._dt, self._dead_band = lower, upper, dt, dead_band
        self._acceleration = np.array([ACCELERATION])
        self.reset(pan)

    def reset(self, pan: float) -> None:
        """Forget every command and hold `pan` [rad]."""
        self.pan_enabled = True
        self._nod_start = None
        self.stop(pan)

    def stop(self, pan: float) -> None:
        """Hold `pan` [rad] at once, and take the next command from there."""
        self._position, self._rate = np.array([pan]), np.zeros(1)
        self._target, self._speed = self._position.copy(), np.array([FULL_SPEED])
        self._resting = False

    def command_pan(self, target: float, speed_ratio: float, enable: bool | None = None) -> None:
        """Turn to `target` [rad], clamped to the limits, at `speed_ratio` (0 to 1) of FULL_SPEED.

        A ratio of 0 means full speed: the vendor's simulator turned at its own speed whatever the ratio, and clients
        that leave the field at 0 expect the head to turn. enable: True or False switches panning on or off, None
        leaves it; while it is off the head stays where it stopped. Raises CommandRefused for numbers that are not
        finite, and for a negative ratio.
        """
        if not (math.isfinite(target) and math.isfinite(speed_ratio)) or speed_ratio < 0.0:
            raise CommandRefused("target is %g rad and speed ratio %g; they must be an angle and a number from 0 to 1"
                                 % (target, speed_ratio))
        if enable is not None:
            self.pan_enabled = enable
        if self.pan_enabled:
            wanted = min(max(target, self._lower), self._upper)
            way = wanted - self._position[0]
            self._target[0] = wanted - math.copysign(min(abs(way), self._dead_band), way)
            self._speed[0] = FULL_SPEED * min(speed_ratio or 1.0, 1.0)
        else:
            self._target[0] = self._position[0]
        self._resting = False

    def nod(self, time_s: float) -> None:
        """Start to nod at time_s [s]; a running nod is not restarted."""
        if not self.is_nodding(time_s):
            self._nod_start = time_s

    def is_nodding(self, time_s: float) -> bool:
        return self._nod_start is not None and 0.0 <= time_s - self._nod_start < NOD_S

    @property
    def commanded_position(self) -> float:
        """Where the set-point is now [rad]."""
        return float(self._position[0])

    @property
    def commanded(self) -> tuple[np.ndarray, np.ndarray]:
        """(position (1,) [rad], velocity (1,) [rad/s]) of the set-point now."""
        return self._position, self._rate

    def update(self) -> tuple[np.ndarray, np.ndarray] | None:
        """One tick: the set-point's (position (1,) [rad], velocity (1,) [rad/s]); None once it rests."""
        if self._resting:
            return None
        self._position, self._rate = approach(
            self._position, self._rate, self._target, self._speed, self._acceleration, self._dt)
        # The tick after the arrival still sends the zero velocity to the joint.
        self._resting = self._position[0] == self._target[0] and self._rate[0] == 0.0
        return self._position, self._rate


class PanDrive:
    """The head's joint in the physics world. model: of bullet_sim; dt, dead_band: as of `HeadHardware`.

    Attributes: `head`, its `HeadHardware`; `joint`, the number of the joint in the model.
    """

    def __init__(self, model: Model, dt: float, dead_band: float = 0.0) -> None:
        self._model, self._index = model, model.index([HEAD_JOINT])
        self.joint = self._index[0]
        self.head = HeadHardware(model.lower[self.joint], model.upper[self.joint], self._pan(), dt, dead_band)

    def _pan(self) -> float:
        return self._model.read_joints()[0][self.joint]

    def stop(self) -> None:
        """The robot was disabled: hold still."""
        self.head.stop(self._pan())

    def reset(self) -> None:
        """The joint was put elsewhere, or the world was reset."""
        self.head.reset(self._pan())

    def update(self) -> None:
        """One tick."""
        setpoint = self.head.update()
        if setpoint is not None:
            self._drive(*setpoint)

    def drive_again(self) -> None:
        """Send the joint where it was sent last."""
        self._drive(*self.head.commanded)

    def _drive(self, position: np.ndarray, velocity: np.ndarray) -> None:
        self._model.drive_position(self._index, position, self._model.max_effort[self._index], velocity=velocity)
