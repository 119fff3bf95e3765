# SPDX-License-Identifier: BSD-3-Clause
"""Start after start until there are solutions enough."""
import math

import numpy as np

from baxter_sim_kinematics.kernels.compiled import compiled
from baxter_sim_kinematics.kernels.descent import reach, walk
from baxter_sim_kinematics.kernels.linear import distance
from baxter_sim_kinematics.kernels.starts import clamped, fill_start, state_of, turn_towards
from baxter_sim_kinematics.kernels.task import pose_error


@compiled
def search(arm, limits, target, tolerances, seed, goal, max_iterations, max_starts, wanted, solution):
    """Look for postures that put the tip on the target, and keep the one nearest ``goal`` (n,).

    The first start is the seed, the others are random postures inside the limits whose generator is seeded by the
    request itself, so the same request gives the same answer bit for bit. Ends after ``wanted`` starts that arrived.

    ``solution`` (n,) gets the answer, or the best attempt. Returns (starts that arrived, starts, iterations, the
    solution's pose error [m], [rad]).
    """
    q, best = np.empty(seed.shape[0]), np.empty(seed.shape[0])
    seed, goal = clamped(seed, limits), clamped(goal, limits)
    state = state_of(target, seed)
    found, starts, iterations, least, nearest = 0, 0, 0, math.inf, math.inf
    for attempt in range(max_starts):
        starts += 1
        fill_start(attempt, state, limits, seed, q)
        solved, used, size = reach(arm, limits, target, tolerances, max_iterations, q, best)
        iterations += used
        if solved:
            turn_towards(arm, limits, goal, best)
            q[:] = best
            iterations += walk(arm, limits, target, tolerances, max_iterations, goal, q, best)
            found += 1
            gap = distance(best, goal)
            if gap < nearest:
                nearest = gap
                solution[:] = best
            if found >= wanted:
                break
        elif found == 0 and size < least:
            least = size
            solution[:] = best
    error_m, error_rad = pose_error(arm, target, solution)
    return found, starts, iterations, error_m, error_rad


@compiled
def search_many(arm, limits, rotations, positions, rows, bases, tolerances, seeds, goals, max_iterations, max_starts,
                wanted, first, last, solutions, outcomes):
    """:func:`search` for the targets ``first`` to ``last`` - 1 of arrays with one entry a target.

    Fills their rows of ``solutions`` (m, n) and ``outcomes`` (m, 5): what search returns.
    """
    for k in range(first, last):
        target = (rotations[k], positions[k], rows, bases[k])
        found, starts, iterations, error_m, error_rad = search(
            arm, limits, target, tolerances, seeds[k], goals[k], max_iterations, max_starts, wanted, solutions[k])
        outcomes[k, 0], outcomes[k, 1], outcomes[k, 2] = found, starts, iterations
        outcomes[k, 3], outcomes[k, 4] = error_m, error_rad


@compiled
def gather(arm, limits, target, tolerances, seed, goal, max_iterations, first_start, max_starts, walked, apart, held,
           solutions):
    """Collect solutions of one target that differ: in at least one joint by ``apart`` [rad or m] from each other.

    Starts number ``first_start`` to ``max_starts`` - 1 of those that :func:`search` would try, until ``solutions``
    (m, n), of which the first ``held`` rows hold some already, is full. With ``walked`` each is taken along its
    self-motion to where it is nearest ``goal``; of two that are the same the first stays.
    Returns (rows filled, starts, iterations).
    """
    n = seed.shape[0]
    q, best = np.empty(n), np.empty(n)
    seed, goal = clamped(seed, limits), clamped(goal, limits)
    state = state_of(target, seed)
    starts, iterations = 0, 0
    for attempt in range(first_start, max_starts):
        if held >= solutions.shape[0]:
            break
        starts += 1
        fill_start(attempt, state, limits, seed, q)
        solved, used, _ = reach(arm, limits, target, tolerances, max_iterations, q, best)
        iterations += used
        if not solved:
            continue
        turn_towards(arm, limits, goal, best)
        if walked:
            q[:] = best
            iterations += walk(arm, limits, target, tolerances, max_iterations, goal, q, best)
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
