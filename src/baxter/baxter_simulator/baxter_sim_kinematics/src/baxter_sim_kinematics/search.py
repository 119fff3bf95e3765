# SPDX-License-Identifier: BSD-3-Clause
"""One target and one chain, searched for under varying limits and budgets."""
import math
from typing import NamedTuple

import numpy as np

from baxter_sim_kinematics import kernels
from baxter_sim_kinematics.target import METRES_PER_RADIAN

# Random starts before a pose counts as unreachable. Of 100,000 random reachable Baxter poses none needed more than 100.
MAX_STARTS = 200
# Iterations of one start. Most arrive within 15; one that makes no progress is left earlier.
MAX_ITERATIONS = 100
# Starts that have to arrive before the service takes the nearest to the seed: 0.5 ms a pose, the true nearest 97 times
# in 100.
SERVICE_CANDIDATES = 16
# Solutions that differ by less than this in every joint [rad or m] are the same one.
APART = 0.05
# Starts and iterations for the nearest pose that can be reached; 40 starts agree with 400 to a millimetre.
_NEAREST_STARTS = 40
_NEAREST_ITERATIONS = 100


class IkResult(NamedTuple):
    """A solution. q: joint values (n,) in chain order, inside the limits. residual_m, residual_rad: what is left of the
    pose error. iterations, restarts: the effort, of all starts together."""

    q: np.ndarray
    residual_m: float
    residual_rad: float
    iterations: int
    restarts: int


class Found(NamedTuple):
    """What a search came to. arrived: starts that did; q: the chosen solution, or the best attempt where none did."""

    arrived: int
    starts: int
    iterations: int
    residual_m: float
    residual_rad: float
    q: np.ndarray


class Search:
    """``seed`` (n,): where it starts. ``goal`` (n,): the posture to which solutions should be near."""

    def __init__(self, chain, target, seed, goal, tolerance_m, tolerance_rad, max_starts=MAX_STARTS,
                 max_iterations=MAX_ITERATIONS):
        """Raises ValueError for tolerances or budgets with which nothing can be found."""
        if not (tolerance_m > 0.0 and tolerance_rad > 0.0 and 1 <= max_starts < math.inf
                and 1 <= max_iterations < math.inf):
            raise ValueError("tolerances must be positive and max_starts, max_iterations finite and at least 1")
        self.chain, self.target, self.seed, self.goal = chain, target, seed, goal
        self.max_starts, self.max_iterations = int(max_starts), int(max_iterations)
        self._tolerances = (float(tolerance_m), float(tolerance_rad))

    def run(self, candidates, max_starts, max_iterations=MAX_ITERATIONS, limits=None, seed=None, goal=None, rows=None):
        """Return what is Found. ``limits``: (lower, upper) in place of the chain's; ``rows``: of the error that
        count.
        """
        q = np.empty(len(self.chain))
        target = self.target
        outcome = kernels.search(
            self.chain.arrays, limits or self.chain.limit_arrays,
            target.arrays if rows is None else (target.rotation, target.position, rows, target.basis), self._tolerances,
            self.seed if seed is None else seed, self.goal if goal is None else goal, max_iterations, max_starts,
            candidates, q)
        return Found(*outcome, q)

    def gather(self, solutions, held, first_start, walked, max_starts=None, limits=None, apart=APART):
        """Fill rows ``held`` and on of ``solutions`` (m, n) with solutions that differ; start number ``first_start``
        first.

        Returns (rows filled, starts used, iterations).
        """
        return kernels.gather(
            self.chain.arrays, limits or self.chain.limit_arrays, self.target.arrays, self._tolerances, self.seed,
            self.goal, self.max_iterations, first_start, self.max_starts if max_starts is None else max_starts, walked,
            float(apart), held, solutions)

    def residual(self, q):
        """Return the pose error of ``q`` (n,): [m], [rad]."""
        return kernels.pose_error(self.chain.arrays, self.target.arrays, q)

    def nearest(self):
        """Return (q, error [m], error [rad]): inside the limits, the tip as near the target as it gets."""
        q = np.empty(len(self.chain))
        errors = kernels.nearest(self.chain.arrays, self.chain.limit_arrays, self.target.arrays, self.seed,
                                 METRES_PER_RADIAN, _NEAREST_ITERATIONS, _NEAREST_STARTS, q)
        return (q, *errors)

    def free_limits(self, joint=None, by=math.inf):
        """Return (lower, upper) with the limits of ``joint`` (index), or of all, moved outwards ``by`` [rad or m]."""
        lower, upper = (limit.copy() for limit in self.chain.limit_arrays)
        which = slice(None) if joint is None else joint
        lower[which] -= by
        upper[which] += by
        return lower, upper
