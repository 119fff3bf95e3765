# SPDX-License-Identifier: BSD-3-Clause
"""One arm behind its actuators, driven by a stream of raw set-points: `baxter_sim_hardware`'s actuators on the rigid
body of `arm_body`. A second of it takes some milliseconds; the full simulator's needs half a second.
"""
from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from baxter_sim_hardware.arms import actuators
from baxter_sim_hardware.arms.actuators import ActuatorCommands, turn
from baxter_sim_hardware.robot import INERTIA_TICKS
from disk_cache.compiled import compiler

from . import arm_body
from .arm_body import GRAVITY, TICK_S, ArmBody, Array, fill_inertia, solve, torques, turn_joints

_compiled = compiler("baxter_sysid", [__file__, arm_body.__file__, actuators.__file__], error_model="numpy")

ARM_TICKS = 5  # the inertia of an arm changes that slowly


class ReplayedMotion(NamedTuple):
    """position (rows, n) [rad]; bounded (rows, n): whether a motor was at its torque limit since the row before;
    effort (rows, n) [Nm]: what the actuators exerted, counterbalance not counted."""

    position: Array
    bounded: Array
    effort: Array


def set_points(commanded: Array, period_s: float, delay_s: float, jitter_s: float = 0.0, seed: int = 0) -> Array:
    """(ticks, n) [rad] set-points of each tick, from commands (rows, n) [rad] every period_s [s] that take delay_s [s]
    to the joints, by the mean; each takes up to half of jitter_s [s] more or less, at random, by `seed`.

    A raw set-point is reached as long after its command came as that came after the one before, at an even pace. Before
    the first command the set-point is there already.
    """
    rows = len(commanded)
    ticks = (rows - 1) * round(period_s / TICK_S)
    time_s = TICK_S * (1.0 + np.arange(ticks))
    came = delay_s + period_s * np.arange(rows)
    if jitter_s > 0.0:
        came += jitter_s * (np.random.default_rng(seed).random(rows) - 0.5)
        # A loop takes commands at its ticks: the set-point waits there for whole ones, which looks like rest to it.
        came = TICK_S * np.round(came / TICK_S)
    return _streamed(np.ascontiguousarray(commanded), came, period_s, time_s)


@_compiled
def _streamed(commanded: Array, came: Array, period_s: float, time_s: Array) -> Array:
    points = np.empty((len(time_s), commanded.shape[1]))
    begun, gap, row = commanded[0].copy(), period_s, 0  # where the set-point was when the newest command came
    for tick in range(len(time_s)):
        while row + 1 < len(came) and came[row + 1] <= time_s[tick]:
            gone = min(max((came[row + 1] - came[row]) / gap, 0.0), 1.0)
            begun += (commanded[row] - begun) * gone
            gap = max(came[row + 1] - came[row], TICK_S)
            row += 1
        points[tick] = begun + (commanded[row] - begun) * min(max((time_s[tick] - came[row]) / gap, 0.0), 1.0)
    return points


def replay(body: ArmBody, known: ArmBody, numbers: Array, start: Sequence[Array], points: Array,
           period_s: float) -> ReplayedMotion:
    """The motion of an arm along set-points.

    known: the arm as gravity compensation knows it; numbers: (k, n) of the actuators, in the order of
    `actuators.NUMBERS`; start: position (n,) [rad], velocity (n,) [rad/s] and, if not 0, the torque (n,) [Nm] that the
    controllers' integrals have beside the load that they do not know, because friction carries it; points: of
    `set_points`. The first row is the start.
    """
    whole = np.zeros((3, len(start[0])))
    whole[:len(start)] = start
    return ReplayedMotion(*_replay(body, known, np.ascontiguousarray(numbers), whole, np.ascontiguousarray(points),
                                   round(period_s / TICK_S)))


@_compiled
def _replay(body: ArmBody, known: ArmBody, numbers: Array, begin: Array, points: Array,
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
    start, velocity, held = begin[0], begin[1], begin[2]
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
        state[3, i] = balance * numbers[16, i] + own[i] - gravity[i] + held[i]
    for tick in range(ticks):
        turn_joints(body, links[0], turned)
        torques(known, turned, still, still, GRAVITY, work, gravity)
        if tick % ARM_TICKS == 0:
            fill_inertia(body, turned, still, unit, work, matrix)
            if tick % INERTIA_TICKS == 0:
                for i in range(count):
                    links[2, i] = matrix[i, i]
        torque = turn(state, begun, numbers, ActuatorCommands(driven, points[tick], still, raw, gravity, limit), links,
                      dt)
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
