# SPDX-License-Identifier: BSD-3-Clause
"""Many poses in one call, on every core."""
from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from arm_kinematics import kernels
from arm_kinematics.budget import USUAL
from arm_kinematics.errors import InvalidPosture
from arm_kinematics.target import Targets

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from arm_kinematics.budget import Budget
    from arm_kinematics.chain import Chain

# Poses that a thread takes at a time: large enough to hide the overhead, small enough to distribute hard poses.
_CHUNK = 64


@dataclass(frozen=True)
class BatchResult:
    """q: (m, n) joint values, inside the limits. solved: (m,) whether they are a solution; otherwise they are the best
    attempt, and :func:`arm_kinematics.solve` says why. residual_m, residual_rad: (m,) remaining pose error [m],
    [rad]. iterations, restarts: (m,) the effort."""

    q: np.ndarray
    solved: np.ndarray
    residual_m: np.ndarray
    residual_rad: np.ndarray
    iterations: np.ndarray
    restarts: np.ndarray


def solve_batch(chain: Chain, targets: Targets | ArrayLike, seeds: ArrayLike, *, postures: ArrayLike | None = None,
                budget: Budget = USUAL, threads: int | None = None) -> BatchResult:
    """Solve for every one of ``targets`` as :func:`arm_kinematics.solve` does; return a BatchResult.

    ``targets``: :class:`Targets`, or poses (m, 4, 4). ``seeds``, ``postures``: (m, n), or (n,) for the same everywhere.
    ``threads``: as many as there are cores by default; the answers do not depend on it. Raises InvalidTarget, with the
    number of the target, InvalidPosture.
    """
    checked = Targets.of(targets)
    count = len(checked)
    seeds = _postures(chain, seeds, count)
    chosen = (seeds, seeds if postures is None else _postures(chain, postures, count))
    solutions, outcomes = np.empty((count, len(chain))), np.empty((count, 5))

    def work(first: int) -> None:
        kernels.search_many(chain.arrays, chain.limit_arrays, checked.arrays, budget.effort, chosen,
                            (first, min(first + _CHUNK, count)), (solutions, outcomes))

    with ThreadPoolExecutor(threads or len(os.sched_getaffinity(0))) as pool:
        for _ in pool.map(work, range(0, count, _CHUNK)):
            pass  # raises the thread's error here
    arrived, starts, iterations, residual_m, residual_rad = outcomes.T
    return BatchResult(solutions, arrived > 0, residual_m.copy(), residual_rad.copy(), iterations.astype(int),
                       starts.astype(int) - 1)


def _postures(chain: Chain, values: ArrayLike, count: int) -> np.ndarray:
    postures = np.array(values, dtype=np.float64)
    if postures.shape == (len(chain),):
        postures = np.tile(chain.posture(postures), (count, 1))
    if postures.shape != (count, len(chain)) or not np.isfinite(postures).all():
        raise InvalidPosture("expected %d finite postures of %d joint values, or one for all, got an array of shape %s"
                             % (count, len(chain), postures.shape), values)
    return np.ascontiguousarray(np.clip(postures, *chain.limit_arrays))
