# SPDX-License-Identifier: BSD-3-Clause
"""Many poses in one call, on every core."""
import math
import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from baxter_sim_kinematics import kernels
from baxter_sim_kinematics.errors import InvalidPosture, InvalidTarget
from baxter_sim_kinematics.search import MAX_ITERATIONS, MAX_STARTS
from baxter_sim_kinematics.target import ROUNDED, Target

# Poses that a thread takes at a time: long enough to hide the hand-over, short enough to share hard poses out.
_CHUNK = 64


@dataclass(frozen=True)
class BatchResult:
    """q: (m, n) joint values, inside the limits. solved: (m,) whether they are a solution; where not, they are the best
    attempt, and :func:`baxter_sim_kinematics.solve` says why. residual_m, residual_rad: (m,) what is left of the error.
    iterations, restarts: (m,) the effort."""

    q: np.ndarray
    solved: np.ndarray
    residual_m: np.ndarray
    residual_rad: np.ndarray
    iterations: np.ndarray
    restarts: np.ndarray


def solve_batch(chain, targets, seeds, tolerance_m=1e-6, tolerance_rad=1e-6, position_only=False, candidates=2,
                max_starts=MAX_STARTS, max_iterations=MAX_ITERATIONS, *, free_axis=None, postures=None, threads=None):
    """Solve for every one of ``targets`` (m, 4, 4) as :func:`baxter_sim_kinematics.solve` does; return a BatchResult.

    ``seeds``, ``postures``: (m, n), or (n,) for the same everywhere. ``threads``: as many as there are cores by
    default; the answers do not depend on it. Raises InvalidTarget, with the number of the target, InvalidPosture,
    ValueError.
    """
    try:
        targets = np.array(targets, dtype=np.float64)
    except (TypeError, ValueError):
        raise InvalidTarget("the targets must be an array (m, 4, 4) of numbers, got %r" % (targets,), targets) from None
    if targets.shape == (0,):
        targets = np.empty((0, 4, 4))
    if targets.ndim != 3 or targets.shape[1:] != (4, 4):
        raise InvalidTarget("the targets must be an array (m, 4, 4), got one of shape %s" % (targets.shape,), targets)
    if not (tolerance_m > 0.0 and tolerance_rad > 0.0
            and all(1 <= number < math.inf for number in (candidates, max_starts, max_iterations))):
        raise ValueError("tolerances must be positive and candidates, max_starts, max_iterations finite and at least 1")
    count = len(targets)
    seeds = _postures(chain, seeds, count)
    goals = seeds if postures is None else _postures(chain, postures, count)
    rotations, positions, bases = np.empty((count, 3, 3)), np.empty((count, 3)), np.empty((count, 3, 3))
    rows = Target(np.eye(4), position_only, free_axis).rows
    for k in range(count):
        if free_axis is None:
            if not kernels.split_pose(targets[k], ROUNDED, rotations[k], positions[k]):
                raise InvalidTarget("target %d must hold a finite position, a rotation, and 0 0 0 1 in its last row, "
                                    "got\n%s" % (k, targets[k]), targets[k])
        else:
            target = Target(targets[k], position_only, free_axis)
            rotations[k], positions[k], bases[k] = target.rotation, target.position, target.basis
    solutions, outcomes = np.empty((count, len(chain))), np.empty((count, 5))
    tolerances = (float(tolerance_m), float(tolerance_rad))

    def work(first):
        kernels.search_many(chain.arrays, chain.limit_arrays, rotations, positions, rows, bases, tolerances, seeds,
                            goals, int(max_iterations), int(max_starts), int(candidates), first,
                            min(first + _CHUNK, count), solutions, outcomes)

    with ThreadPoolExecutor(threads or len(os.sched_getaffinity(0))) as pool:
        for _ in pool.map(work, range(0, count, _CHUNK)):
            pass  # raises here what was raised there
    arrived, starts, iterations, residual_m, residual_rad = outcomes.T
    return BatchResult(solutions, arrived > 0, residual_m.copy(), residual_rad.copy(), iterations.astype(int),
                       starts.astype(int) - 1)


def _postures(chain, values, count):
    postures = np.array(values, dtype=np.float64)
    if postures.shape == (len(chain),):
        postures = np.tile(chain.posture(postures), (count, 1))
    if postures.shape != (count, len(chain)) or not np.isfinite(postures).all():
        raise InvalidPosture("expected %d finite postures of %d joint values, or one for all, got an array of shape %s"
                             % (count, len(chain), postures.shape), values)
    return np.ascontiguousarray(np.clip(postures, *chain.limit_arrays))
