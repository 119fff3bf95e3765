# SPDX-License-Identifier: BSD-3-Clause
"""Replaces the active trajectory by a new command."""
from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from .command import Indices, TrajectoryCommand, joint_indices
from .errors import AllPointsInPast
from .goal_monitor import Flags
from .segment import CUBIC, LINEAR, QUINTIC, Floats, constant, shifted, smooth_velocities, splines
from .trajectory import Trajectory

# Near half a turn, within this margin, both directions count as equally short [rad].
_HALF_TURN_TOLERANCE = 1e-9


class Replacement(NamedTuple):
    """``trajectory``; ``begins`` (n,): time [s] from which each joint follows the command; ``dropped``: number of
    points left out because their time has passed; ``late_s``: time since the first of them was due [s]."""

    trajectory: Trajectory
    begins: Floats
    dropped: int
    late_s: float


def replace(current: Trajectory, command: TrajectoryCommand, now: float, joint_names: Sequence[str], continuous: Flags,
            allow_partial: bool = False, smooth: bool = False) -> Replacement:
    """Follow ``current`` until ``command`` begins, then the command: a :class:`Replacement`.

    ``current``: :class:`Trajectory` of ``joint_names``; ``command``: :class:`TrajectoryCommand` with points; ``now``
    [s]: the first time that can still be changed, not before the start of ``current``; ``continuous`` (n,) bool: joints
    without position limits.

    Points at or before ``now`` are left out. A bridge leads from the current trajectory, at the start of the command
    or ``now``, whichever is later, to the first point that is left. Continuous joints take the shorter way round: all
    their points are shifted by whole turns. Joints that the command does not name stay on their current trajectory.

    ``smooth``: for joints that must not be jerked. Points without velocities get some, so that the curve is smooth and
    does not overshoot; the last point gets velocity and acceleration zero; and a point due at the very start of the
    command is replaced by the joints' position then.

    Raises :class:`JointNamesError` and :class:`AllPointsInPast`.
    """
    named = joint_indices(command.joint_names, joint_names, allow_partial)
    start = now if command.start_time is None else command.start_time
    times = start + command.times
    bridge_start = max(start, now)
    dropped = int(np.searchsorted(times, bridge_start if smooth else now, side="right"))
    if dropped == len(times):
        raise AllPointsInPast(dropped, now - times[-1])

    from_state = current.sample(bridge_start)[:, named]
    positions = command.positions[dropped:].copy()
    for column in np.flatnonzero(continuous[named]):
        positions[:, column] += whole_turns(from_state[0, column], positions[0, column])
    times = times[dropped:]
    degrees = command.degrees[dropped:]
    velocities, accelerations = command.velocities[dropped:], command.accelerations[dropped:]
    if times[0] > bridge_start:
        times = np.concatenate([[bridge_start], times])
        degrees = np.concatenate([[QUINTIC], degrees])
        positions = np.concatenate([from_state[:1], positions])
        velocities = np.concatenate([from_state[1:2], velocities])
        accelerations = np.concatenate([from_state[2:], accelerations])
    if smooth:
        velocities, accelerations, degrees = _smoothed(times, positions, velocities, accelerations, degrees)
    coefficients = np.concatenate([splines(times, positions, velocities, accelerations, degrees),
                                   constant(positions[-1])[None]])

    late_s = max(now - (start + command.times[0]), 0.0) if dropped else 0.0
    begins = np.full(len(joint_names), now, dtype=float)
    begins[named] = bridge_start
    end_times = current.end_times.copy()
    end_times[named] = times[-1]
    return Replacement(_merged(current, now, times, coefficients, named, end_times), begins, dropped, late_s)


def _smoothed(times: Floats, positions: Floats, velocities: Floats, accelerations: Floats,
              degrees: Indices) -> tuple[Floats, Floats, Indices]:
    """Velocities for the points that have none, and rest at the last one."""
    velocities = np.where((degrees == LINEAR)[:, None], smooth_velocities(times, positions), velocities)
    velocities[-1] = 0.0
    accelerations = accelerations.copy()
    accelerations[-1] = 0.0
    return velocities, accelerations, np.maximum(degrees, CUBIC)


def whole_turns(position: float, target: float) -> float:
    """The multiple of a full turn [rad] to add to ``target``, so that it is nearest to ``position``.

    If both directions are equally long, it keeps the sign of ``target - position``.
    """
    way = math.remainder(target - position, 2.0 * math.pi)
    if abs(abs(way) - math.pi) < _HALF_TURN_TOLERANCE:
        way = math.copysign(way, target - position)
    return position + way - target


def _merged(current: Trajectory, now: float, starts: Floats, coefficients: Floats, named: Indices,
            end_times: Floats) -> Trajectory:
    """``current`` from the piece that holds ``now`` on; from ``starts[0]`` on the columns ``named`` are replaced."""
    first = max(int(np.searchsorted(current.starts, now, side="right")) - 1, 0)
    kept = current.starts[first:]
    if len(named) == len(end_times):
        kept = kept[kept < starts[0]]
        merged = np.empty((len(starts), *current.coefficients.shape[1:]))
        merged[:, :, named] = coefficients
        return Trajectory(np.concatenate([kept, starts]),
                          np.concatenate([current.coefficients[first:first + len(kept)], merged]), end_times)
    # The pieces of all joints begin at the same times, so each curve is cut where the others have points.
    cuts = np.union1d(kept, starts)
    merged = _cut(current.starts, current.coefficients, cuts)
    new = cuts >= starts[0]
    merged[np.ix_(new, np.arange(6), named)] = _cut(starts, coefficients, cuts[new])
    return Trajectory(cuts, merged, end_times)


def _cut(starts: Floats, coefficients: Floats, cuts: Floats) -> Floats:
    """The curves that begin at ``starts``, as pieces that begin at ``cuts`` (none before the first start)."""
    pieces = np.searchsorted(starts, cuts, side="right") - 1
    return shifted(coefficients[pieces], cuts - starts[pieces])
