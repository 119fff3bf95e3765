# SPDX-License-Identifier: BSD-3-Clause
"""Set-points that move no faster and no harder than allowed, and arrive exactly."""

from __future__ import annotations

import math

import numpy as np

from disk_cache.compiled import compiler

from .joint_modes import POSITION, RAW_POSITION, VELOCITY

_compiled = compiler("baxter_sim_hardware", [__file__], error_model="numpy")


@_compiled
def _approach(position: float, velocity: float, target: float, speed: float, acceleration: float,
              dt: float) -> tuple[float, float]:
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
def approach(position: np.ndarray, velocity: np.ndarray, target: np.ndarray, speed: np.ndarray,
             acceleration: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray]:
    """One tick of a trapezoidal velocity profile in discrete time, for n joints at once.

    position [rad], velocity [rad/s]: (n,) state of the set-point; target [rad]: (n,) where it comes to rest;
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


class SetPoints:
    """The arrays that `follow` updates, (n,) each.

    position [rad], velocity [rad/s]: state of the set-points. target [rad]: where they go, at most at speed [rad/s] and
    with acceleration [rad/s^2], or, where `braking`, with stopping [rad/s^2]. Where `streams`, the target itself moves
    to goal [rad], by at most pace [rad/s] (of either sign). output [rad], output_rate [rad/s], output_change [rad/s^2]:
    set-points of the drives, with the position smoothed.

    All are views of two arrays, `numbers` and `flags`: passing sixteen arrays to a compiled function takes longer than
    moving fourteen joints.
    """

    def __init__(self, count: int) -> None:
        self.numbers, self.flags = np.zeros((12, count)), np.zeros((2, count), dtype=bool)
        (self.position, self.velocity, self.target, self.speed, self.acceleration, self.stopping, self.goal, self.pace,
         self.output, self.output_rate, self.output_change, self.stream_acceleration) = self.numbers
        self.braking, self.streams = self.flags


@_compiled
def follow(numbers: np.ndarray, flags: np.ndarray, window: np.ndarray, oldest: int, measured: np.ndarray, reach: float,
           dt: float) -> tuple[bool, bool, bool]:
    """One tick of `approach`, smoothed, for set-points of which some brake and some follow a stream.

    numbers, flags: of `SetPoints`, moved in place; window: (k, n), the last k values of position, of which row `oldest`
    is replaced, and whose mean is the output. measured: (n,) joint positions [rad] before this tick; reach [rad]:
    largest lead of a set-point. In a stream, the profile runs in a frame that moves with the target, so that a smooth
    stream is followed without lag; streams and braking are not smoothed.

    Returns whether every set-point rests on its target; whether some were braking when the tick began; whether some are
    too far from their joints.
    """
    position, velocity, target, speed, acceleration, stopping, goal, pace, output, output_rate, output_change, hard = (
        numbers[0], numbers[1], numbers[2], numbers[3], numbers[4], numbers[5], numbers[6], numbers[7], numbers[8],
        numbers[9], numbers[10], numbers[11])
    braking, streams = flags[0], flags[1]
    rests, braked, leads = True, False, False
    for i in range(len(position)):
        bound = stopping[i] if braking[i] else acceleration[i]
        if streams[i]:
            ahead = goal[i] - target[i]
            rate = math.copysign(min(abs(pace[i]), abs(ahead) / dt), ahead)
            offset, velocity[i] = _approach(
                position[i] - target[i], velocity[i] - rate, 0.0, speed[i] - abs(rate), hard[i], dt)
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
        rate = (mean - output[i]) / dt
        output_change[i] = (rate - output_rate[i]) / dt
        output_rate[i] = rate
        output[i] = mean
        braked |= braking[i]
        rests &= velocity[i] == 0.0 and abs(mean - target[i]) < 1e-12
        leads |= abs(mean - output_rate[i] * dt - measured[i]) > reach
    return rests, braked, leads


@_compiled
def any_beyond(reach: float, position: np.ndarray, velocity: np.ndarray, measured: np.ndarray, dt: float) -> bool:
    """Whether any set-point, `position` (n,) [rad] as it was a tick of `velocity` (n,) ago, is farther than reach [rad]
    from the measured position (n,)."""
    for i in range(len(position)):
        if abs(position[i] - velocity[i] * dt - measured[i]) > reach:
            return True
    return False


@_compiled
def approach_rates(index: np.ndarray, target: np.ndarray, position: np.ndarray, acceleration: np.ndarray,
                   speed: np.ndarray, moves: np.ndarray) -> np.ndarray:
    """(k,) [rad/s] speeds at which joints `index` (k,) of n would go to their targets, or slow before them; 0 where
    `moves` (n,) is false. The other arrays are (n,) [rad, rad/s, rad/s^2]."""
    rates = np.zeros(len(index))
    for i, joint in enumerate(index):
        if moves[joint]:
            ahead = target[joint] - position[joint]
            rates[i] = math.copysign(min(speed[joint], math.sqrt(2.0 * acceleration[joint] * abs(ahead))), ahead)
    return rates


class Speeds:
    """The numbers that the speeds of n set-points follow from, (n,) each, all views of the array `numbers`.

    limit: of the joints [rad/s]; share, ratio: of it, in position mode, which a joint needs to move in step with
    others, and which its limb may use; slowing: of its speed that collision avoidance leaves to its limb; nominal: its
    speed if nothing slows the limb [rad/s]; stream: bound of a stream of raw set-points [rad/s].
    """

    def __init__(self, limit: np.ndarray, ratio: float, stream: np.ndarray) -> None:
        self.numbers = np.ones((6, len(limit)))
        self.limit, self.share, self.ratio, self.slowing, self.nominal, self.stream = self.numbers
        self.limit[:], self.ratio[:], self.stream[:] = limit, ratio, stream


@_compiled
def shares_in_step(index: np.ndarray, target: np.ndarray, position: np.ndarray, speeds: np.ndarray,
                   least: float) -> bool:
    """Make joints `index` (k,) of n arrive at target (k,) [rad] together: set their shares in `numbers` of `Speeds`, of
    which none falls below `least`. position: (n,) [rad] where they are. Returns whether one has changed."""
    limit, share = speeds[0], speeds[1]
    longest = 0.0
    for i, joint in enumerate(index):
        longest = max(longest, abs(target[i] - position[joint]) / limit[joint])
    changed = False
    for i, joint in enumerate(index):
        wanted = 1.0
        if longest > 0.0:
            wanted = max(abs(target[i] - position[joint]) / limit[joint] / longest, least)
        changed |= share[joint] != wanted
        share[joint] = wanted
    return changed


@_compiled
def cruising_speeds(speeds: np.ndarray, mode: np.ndarray, braking: np.ndarray, value: np.ndarray,
                    speed: np.ndarray) -> None:
    """Set the nominal speeds of `numbers` of `Speeds`, and speed (n,) [rad/s], at which each set-point cruises now.

    mode: (n,) ints of `Mode`; braking: (n,) bool; value: (n,) [rad/s] commanded in velocity mode. Nothing slows a
    set-point in raw position mode or one that brakes.
    """
    limit, share, ratio, slowing, nominal, stream = speeds[0], speeds[1], speeds[2], speeds[3], speeds[4], speeds[5]
    for i in range(len(limit)):
        nominal[i] = limit[i]
        if mode[i] == POSITION and not braking[i]:
            nominal[i] = share[i] * limit[i] * ratio[i]
        elif mode[i] == VELOCITY:
            nominal[i] = abs(value[i])
        elif mode[i] == RAW_POSITION and not braking[i]:
            nominal[i] = stream[i]
        speed[i] = nominal[i]
        if mode[i] != RAW_POSITION and not braking[i]:
            speed[i] *= slowing[i]


def stopping_point(position: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
    """Rest positions of set-points that start to brake now [rad]; all (n,)."""
    return position + velocity * np.abs(velocity) / (2.0 * acceleration)


class MovingAverage:
    """The last `ticks` values of n set-points, of which `follow` takes the mean.

    Clients stream positions as a staircase, typically at 100 or 50 Hz; a profile that chases each stair would shake
    the arm at that rate. A window of 20 ms spans a whole number of stairs at both rates and so removes them.
    It costs half a window of delay and still arrives exactly.
    """

    def __init__(self, ticks: int, values: np.ndarray) -> None:
        #: (ticks, n), and the row in it that `follow` replaces next.
        self.window = np.tile(values, (ticks, 1))
        self.oldest = 0

    def turn(self) -> None:
        """End the tick: advance to the next oldest row."""
        self.oldest = (self.oldest + 1) % len(self.window)

    def shift(self, mask: np.ndarray, offset: np.ndarray) -> None:
        """Shift the history of the joints in `mask` by `offset`, so that their mean moves by exactly that."""
        self.window[:, mask] += offset

    def restart(self, mask: np.ndarray, values: np.ndarray) -> None:
        """Forget the history of the joints in `mask`."""
        self.window[:, mask] = values
