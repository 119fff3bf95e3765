# SPDX-License-Identifier: BSD-3-Clause
"""Set-points that move no faster and no harder than allowed, and arrive exactly."""
import math
from typing import NamedTuple

import numpy as np

# Makes sure that numba has a place for its cache; numba looks for one when it is imported.
import baxter_sim_kinematics  # noqa: F401  isort: skip
import numba  # isort: skip

# All that is compiled stands in one file: numba's cache notices a change of that file alone.
_compiled = numba.njit(cache=True, error_model="numpy")


@_compiled
def _approach(position, velocity, target, speed, acceleration, dt):
    distance = target - position
    step = acceleration * dt
    left = abs(distance) / (step * dt)
    whole = np.floor(math.sqrt(0.25 + 2.0 * left) - 0.5)
    braking = step * (whole + (left - 0.5 * whole * (whole + 1.0)) / (whole + 1.0))
    wanted = math.copysign(min(braking, speed), distance)
    velocity += min(max(wanted - velocity, -step), step)
    moved = velocity * dt
    return (target if abs(distance - moved) < 1e-12 else position + moved), velocity


@_compiled
def approach(position, velocity, target, speed, acceleration, dt):
    """One tick of a trapezoidal velocity profile in discrete time, for n joints at once.

    position [rad], velocity [rad/s]: (n,) where the set-point is; target [rad]: (n,) where it is to rest;
    speed [rad/s] >= 0 and acceleration [rad/s^2] > 0: (n,) bounds; dt [s]. Returns the new (position, velocity).

    The braking speed is that from which the ticks to standstill, each slower by a dt, cover exactly the distance left.
    In units of a dt^2 a distance d is covered by n + f, n - 1 + f, ... f with n the largest whole number for which
    n (n + 1) / 2 <= d and f = (d - n (n + 1) / 2) / (n + 1). The sum is the discrete one, so the profile ends on the
    target itself, without a creep and without an overshoot.
    """
    new_position, new_velocity = np.empty_like(position), np.empty_like(velocity)
    for i in range(len(position)):
        new_position[i], new_velocity[i] = _approach(
            position[i], velocity[i], target[i], speed[i], acceleration[i], dt)
    return new_position, new_velocity


class Moved(NamedTuple):
    """What :func:`follow` found."""

    rests: bool  # every set-point stands on its target
    braked: bool  # some of them were braking when the tick began
    leads: bool  # some of them is too far from its joint


@_compiled
def follow(position, velocity, target, speed, acceleration, braking, stopping, streams, goal, pace, window, oldest,
           output, output_rate, measured, reach, dt):
    """One tick of `approach`, smoothed, for set-points of which some brake and some follow a stream.

    All arrays (n,) but window, (k, n), the last k values of position, of which row `oldest` is replaced. Moved in
    place: position [rad], velocity [rad/s], the target of streams, window, and output [rad] and output_rate [rad/s],
    which are the mean over the window and its rate. Returns `Moved`.

    braking: the joints that brake with `stopping` instead of `acceleration` [rad/s^2]. streams: the joints whose target
    is itself on the way to goal [rad], by at most pace [rad/s] (of either sign); their profile runs in a frame that
    moves with the target, so that a smooth stream is followed without lag. Neither is smoothed. measured: where the
    joints are [rad], before this tick; reach [rad]: what a set-point may lead by.
    """
    rests, braked, leads = True, False, False
    for i in range(len(position)):
        bound = stopping[i] if braking[i] else acceleration[i]
        if streams[i]:
            ahead = goal[i] - target[i]
            rate = math.copysign(min(abs(pace[i]), abs(ahead) / dt), ahead)
            offset, velocity[i] = _approach(
                position[i] - target[i], velocity[i] - rate, 0.0, speed[i] - abs(rate), bound, dt)
            target[i] += rate * dt
            position[i] = target[i] + offset
            velocity[i] += rate
        else:
            position[i], velocity[i] = _approach(position[i], velocity[i], target[i], speed[i], bound, dt)
        if streams[i] or braking[i]:
            window[:, i] = position[i]
        else:
            window[oldest, i] = position[i]
        mean = 0.0
        for k in range(len(window)):
            mean += window[k, i]
        mean /= len(window)
        output_rate[i] = (mean - output[i]) / dt
        output[i] = mean
        braked |= braking[i]
        rests &= velocity[i] == 0.0 and abs(mean - target[i]) < 1e-12
        leads |= abs(mean - output_rate[i] * dt - measured[i]) > reach
    return Moved(rests, braked, leads)


@_compiled
def any_beyond(reach, position, velocity, measured, dt):
    """Whether any set-point, `position` (n,) [rad] as it was a tick of `velocity` (n,) ago, is farther than reach [rad]
    from what is measured there, (n,)."""
    for i in range(len(position)):
        if abs(position[i] - velocity[i] * dt - measured[i]) > reach:
            return True
    return False


def stopping_point(position, velocity, acceleration):
    """Where set-points that brake now come to rest [rad]; all (n,)."""
    return position + velocity * np.abs(velocity) / (2.0 * acceleration)


class MovingAverage:
    """The last `ticks` values of n set-points, of which `follow` takes the mean.

    Clients stream positions as a staircase, typically at 100 or 50 Hz; a profile that chases each stair would shake
    the arm at that rate. A window of 20 ms spans a whole number of stairs at both rates and so removes them.
    It costs half a window of delay and still arrives exactly.
    """

    def __init__(self, ticks, values):
        #: (ticks, n), and the row in it that `follow` replaces next.
        self.window = np.tile(values, (ticks, 1))
        self.oldest = 0

    def turn(self):
        """A tick is over: another row is the oldest now."""
        self.oldest = (self.oldest + 1) % len(self.window)

    def shift(self, mask, offset):
        """Move the past of the joints in `mask` by `offset`, so that their mean moves by exactly that."""
        self.window[:, mask] += offset

    def restart(self, mask, values):
        """Forget the past of the joints in `mask`."""
        self.window[:, mask] = values
