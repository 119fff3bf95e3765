# SPDX-License-Identifier: BSD-3-Clause
"""Set-points that move no faster and no harder than allowed, and arrive exactly."""
import numpy as np


def approach(position, velocity, target, speed, acceleration, dt):
    """One tick of a trapezoidal velocity profile in discrete time, for n joints at once.

    position [rad], velocity [rad/s]: (n,) where the set-point is; target [rad]: (n,) where it is to rest;
    speed [rad/s] >= 0 and acceleration [rad/s^2] > 0: (n,) bounds; dt [s]. Returns the new (position, velocity).

    The braking speed is that from which the ticks to standstill, each slower by a dt, cover exactly the distance left.
    In units of a dt^2 a distance d is covered by n + f, n - 1 + f, ... f with n the largest whole number for which
    n (n + 1) / 2 <= d and f = (d - n (n + 1) / 2) / (n + 1). The sum is the discrete one, so the profile ends on the
    target itself, without a creep and without an overshoot.
    """
    distance = target - position
    step = acceleration * dt
    left = np.abs(distance) / (step * dt)
    whole = np.floor(np.sqrt(0.25 + 2.0 * left) - 0.5)
    braking = step * (whole + (left - 0.5 * whole * (whole + 1.0)) / (whole + 1.0))
    wanted = np.copysign(np.minimum(braking, speed), distance)
    velocity = velocity + np.minimum(np.maximum(wanted - velocity, -step), step)
    moved = velocity * dt
    arrived = np.abs(distance - moved) < 1e-12
    return np.where(arrived, target, position + moved), velocity


def stopping_point(position, velocity, acceleration):
    """Where set-points that brake now come to rest [rad]; all (n,)."""
    return position + velocity * np.abs(velocity) / (2.0 * acceleration)


class MovingAverage:
    """Mean of the last `ticks` values of n set-points.

    Clients stream positions as a staircase, typically at 100 or 50 Hz; a profile that chases each stair would shake
    the arm at that rate. A window of 20 ms spans a whole number of stairs at both rates and so removes them.
    It costs half a window of delay and still arrives exactly.
    """

    def __init__(self, ticks, values):
        self._window = np.tile(values, (ticks, 1))
        self._oldest = 0

    def push(self, values):
        """Take the newest values, (n,); return the mean, (n,)."""
        self._window[self._oldest] = values
        self._oldest = (self._oldest + 1) % len(self._window)
        return np.add.reduce(self._window) / len(self._window)

    def shift(self, mask, offset):
        """Move the past of the joints in `mask` by `offset`, so that their mean moves by exactly that."""
        self._window[:, mask] += offset

    def restart(self, mask, values):
        """Forget the past of the joints in `mask`."""
        self._window[:, mask] = values
