# SPDX-License-Identifier: BSD-3-Clause
"""Search from many starts until there are enough solutions."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from arm_kinematics.kernels.compiled import compiled
from arm_kinematics.kernels.descent import reach, walk
from arm_kinematics.kernels.linear import distance
from arm_kinematics.kernels.starts import clamped, fill_start, state_of, turn_towards
from arm_kinematics.kernels.task import pose_error

if TYPE_CHECKING:
    from arm_kinematics.kernels import Arm, Effort, Gathering, Limits, Postures, TargetArrays


@compiled
def search(arm: Arm, limits: Limits, target: TargetArrays, effort: Effort, postures: Postures,
           solution: np.ndarray) -> tuple[int, int, int, float, float]:
    """Look for postures that put the tip on the target, and keep the one nearest the preferred posture.

    The first start is the seed, the others are random postures inside the limits. Their generator is seeded by the
    request, so the same request gives the same answer bit for bit. Ends when as many starts have arrived as the
    effort's ``candidates``.

    ``solution`` (n,) gets the answer, or the best attempt. Returns (starts that arrived, starts, iterations, the
    solution's pose error [m], [rad]).
    """
    seed, preferred = clamped(postures[0], limits), clamped(postures[1], limits)
    q, best = np.empty(seed.shape[0]), np.empty(seed.shape[0])
    state, (_, _, _, max_starts, candidates) = state_of(target, seed), effort
    found, starts, iterations, least, nearest = 0, 0, 0, math.inf, math.inf
    for attempt in range(max_starts):
        starts += 1
        fill_start(attempt, state, limits, seed, q)
        solved, used, size = reach(arm, limits, target, effort, q, best)
        iterations += used
        if solved:
            turn_towards(arm, limits, preferred, best)
            q[:] = best
            iterations += walk(arm, limits, target, effort, preferred, q, best)
            found += 1
            gap = distance(best, preferred)
            if gap < nearest:
                nearest = gap
                solution[:] = best
            if found >= candidates:
                break
        elif found == 0 and size < least:
            least = size
            solution[:] = best
    error_m, error_rad = pose_error(arm, target, solution)
    return found, starts, iterations, error_m, error_rad


@compiled
def search_many(arm: Arm, limits: Limits, targets: TargetArrays, effort: Effort, postures: Postures,
                part: tuple[int, int], answers: tuple[np.ndarray, np.ndarray]) -> None:
    """:func:`search` for a ``part`` (first, last + 1) of the targets.

    ``targets`` and ``postures`` have arrays with one entry per target. ``answers``: (solutions (m, n), outcomes (m, 5):
    what search returns), of which the rows of this part are filled.
    """
    (rotations, positions, rows, bases), (seeds, preferred), (solutions, outcomes) = targets, postures, answers
    for k in range(part[0], part[1]):
        found, starts, iterations, error_m, error_rad = search(
            arm, limits, (rotations[k], positions[k], rows, bases[k]), effort, (seeds[k], preferred[k]), solutions[k])
        outcomes[k, 0], outcomes[k, 1], outcomes[k, 2] = found, starts, iterations
        outcomes[k, 3], outcomes[k, 4] = error_m, error_rad


@compiled
def gather(arm: Arm, limits: Limits, target: TargetArrays, effort: Effort, postures: Postures, collection: Gathering,
           solutions: np.ndarray) -> tuple[int, int, int]:
    """Collect different solutions of one target, as ``collection`` describes, in the rows of ``solutions`` (m, n).

    Makes the starts that :func:`search` would make, from the collection's first to the effort's last, until the rows
    are full; of two equal solutions the first one stays. Returns (rows filled, starts, iterations).
    """
    seed, preferred = clamped(postures[0], limits), clamped(postures[1], limits)
    n, (held, first_start, settle, apart) = seed.shape[0], collection
    q, best = np.empty(n), np.empty(n)
    state, (_, _, _, max_starts, _) = state_of(target, seed), effort
    starts, iterations = 0, 0
    for attempt in range(first_start, max_starts):
        if held >= solutions.shape[0]:
            break
        starts += 1
        fill_start(attempt, state, limits, seed, q)
        solved, used, _ = reach(arm, limits, target, effort, q, best)
        iterations += used
        if not solved:
            continue
        turn_towards(arm, limits, preferred, best)
        if settle:
            q[:] = best
            iterations += walk(arm, limits, target, effort, preferred, q, best)
        new = True
        for k in range(held):
            gap = 0.0
            for i in range(n):
                gap = max(gap, abs(best[i] - solutions[k, i]))
            if gap < apart:
                new = False
                break
        if new:
            solutions[held] = best
            held += 1
    return held, starts, iterations
