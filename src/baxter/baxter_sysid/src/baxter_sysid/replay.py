# SPDX-License-Identifier: BSD-3-Clause
"""One arm behind its actuators, driven by a stream of raw set-points: `baxter_sim_hardware`'s actuators on the rigid
body of `arm_body`. A second of it takes some milliseconds; the full simulator's needs half a second.
"""
from __future__ import annotations

from typing import NamedTuple

import numpy as np

from baxter_sim_hardware.arms import actuators
from baxter_sim_hardware.arms.actuators import Wanted, turn
from baxter_sim_hardware.robot import INERTIA_TICKS
from disk_cache.compiled import compiler

from . import arm_body
from .arm_body import GRAVITY, TICK_S, ArmBody, Array, fill_inertia, solve, torques, turn_joints

_compiled = compiler("baxter_sysid", [__file__, arm_body.__file__, actuators.__file__], error_model="numpy")

ARM_TICKS = 5  # the inertia of an arm changes that slowly


class Motion(NamedTuple):
    """position (rows, n) [rad]; bounded (rows, n): whether a motor was at its torque limit since the row before;
    effort (rows, n) [Nm]: what the actuators exerted, counterbalance not counted."""

    position: Array
    bounded: Array
    effort: Array


def set_points(commanded: Array, period_s: float, delay_s: float) -> Array:
    """(ticks, n) [rad] set-points of each tick, from commands (rows, n) [rad] every period_s [s] that take delay_s [s]
    to the joints.

    A raw set-point is reached a period after its command came, at an even pace. Before the first command the set-point
    is there already.
    """
    rows = len(commanded)
    ticks = round((rows - 1) * period_s / TICK_S)
    time_s = TICK_S * (1.0 + np.arange(ticks)) - delay_s - period_s
    there = period_s * np.arange(rows)
    return np.stack([np.interp(time_s, there, joint) for joint in commanded.T], axis=1)


def replay(body: ArmBody, known: ArmBody, numbers: Array, start: tuple[Array, Array], points: Array,
           period_s: float) -> Motion:
    """The motion of an arm along set-points.

    known: the arm as gravity compensation knows it; numbers: (k, n) of the actuators, in the order of
    `actuators.NUMBERS`; start: position (n,) [rad] and velocity (n,) [rad/s]; points: of `set_points`. The first row is
    the start.
    """
    return Motion(*_replay(body, known, np.ascontiguousarray(numbers), start[0], start[1],
                           np.ascontiguousarray(points), round(period_s / TICK_S)))


@_compiled
def _replay(body: ArmBody, known: ArmBody, numbers: Array, start: Array, velocity: Array, points: Array,
            every: int) -> tuple[Array, Array, Array]:
    dt = TICK_S
    ticks, count = points.shape
    rows = ticks // every + 1
    positions, bounded, efforts = np.empty((rows, count)), np.zeros((rows, count)), np.zeros((rows, count))
    state, begun = np.zeros((7, count)), np.zeros(count, dtype=np.bool_)
    driven, raw, still = np.ones(count, dtype=np.bool_), np.zeros(count, dtype=np.bool_), np.zeros(count)
    limit, links, unit = numbers[10].copy(), np.zeros((3, count)), np.zeros(count)
    turned, work, matrix, factor = (np.empty((count, 3, 3)), np.empty((count, 6)), np.empty((count, count)),
                                    np.empty((count, count)))
    gravity, own = np.empty(count), np.empty(count)
    links[0], links[1] = start, velocity
    positions[0] = start
    # It rested, or moved for long: the integral has what the controller does not know of the load.
    turn_joints(body, start, turned)
    torques(body, turned, still, still, GRAVITY, work, own)
    torques(known, turned, still, still, GRAVITY, work, gravity)
    for i in range(count):
        balance = numbers[11, i] + numbers[12, i] * start[i]
        begun[i] = True
        state[0, i] = start[i] + (own[i] + balance * (1.0 + numbers[16, i])) / numbers[0, i]
        state[1, i], state[2, i], state[4, i] = velocity[i], points[0, i], points[0, i]
        state[3, i] = balance * numbers[16, i] + own[i] - gravity[i]
    for tick in range(ticks):
        turn_joints(body, links[0], turned)
        torques(known, turned, still, still, GRAVITY, work, gravity)
        if tick % ARM_TICKS == 0:
            fill_inertia(body, turned, still, unit, work, matrix)
            if tick % INERTIA_TICKS == 0:
                for i in range(count):
                    links[2, i] = matrix[i, i]
        torque = turn(state, begun, numbers, Wanted(driven, points[tick], still, raw, gravity, limit), links, dt)
        torques(body, turned, links[1], still, GRAVITY, work, own)
        row = tick // every + 1
        for i in range(count):
            balance = numbers[11, i] + numbers[12, i] * links[0, i]
            efforts[row, i] = torque[i] + balance * (1.0 + numbers[16, i])
            if abs(state[6, i] + gravity[i] + balance) > limit[i]:
                bounded[row, i] = 1.0
            own[i] = torque[i] - own[i] - body.damping[i] * links[1, i]
        solve(matrix, own, factor)
        for i in range(count):
            links[1, i] += dt * own[i]
            links[0, i] += dt * links[1, i]
        if (tick + 1) % every == 0:
            positions[row] = links[0]
    return positions, bounded, efforts
