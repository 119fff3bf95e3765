# SPDX-License-Identifier: BSD-3-Clause
"""Searches for one target of one chain, under varying limits and budgets."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from arm_kinematics import kernels
from arm_kinematics.budget import Budget
from arm_kinematics.target import METRES_PER_RADIAN

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from arm_kinematics.chain import Chain
    from arm_kinematics.kernels import Limits, Postures, Rows
    from arm_kinematics.target import Target

# Solutions that differ by less than this in every joint [rad or m] are the same one.
APART = 0.05
# For the nearest pose that can be reached; 40 starts agree with 400 to a millimetre.
_NEAREST = Budget(max_starts=40, max_iterations=100)


class IkResult(NamedTuple):
    """A solution. q: joint values (n,) in chain order, inside the limits. residual_m, residual_rad: the remaining pose
    error. iterations, restarts: the effort of all starts together."""

    q: np.ndarray
    residual_m: float
    residual_rad: float
    iterations: int
    restarts: int


class SearchResult(NamedTuple):
    """The result of a search. arrived: number of starts that arrived; q: the chosen solution, or the best attempt if
    none arrived."""

    arrived: int
    starts: int
    iterations: int
    residual_m: float
    residual_rad: float
    q: np.ndarray


class Collection(NamedTuple):
    """How :meth:`Search.gather` fills its rows.

    held: number of filled rows. first_start: number of the first start. settle: each solution moves along
    its self-motion to the point nearest the preferred posture. apart: least difference of two solutions in some joint
    [rad or m].
    """

    held: int = 0
    first_start: int = 0
    settle: bool = True
    apart: float = APART


class Search:
    """A :class:`Target`, a Chain and a :class:`Budget`.

    ``seed`` (n,): where it starts; ``posture`` (n,): the one that solutions should be near, the seed if None.
    Raises InvalidPosture for values that do not fit the chain.
    """

    def __init__(self, chain: Chain, target: Target, seed: ArrayLike, posture: ArrayLike | None,
                 budget: Budget) -> None:
        self.chain, self.target, self.budget = chain, target, budget
        self.seed = chain.posture(seed)
        self.preferred = self.seed if posture is None else chain.posture(posture)

    def run(self, *, budget: Budget | None = None, limits: Limits | None = None, postures: Postures | None = None,
            rows: Rows | None = None) -> SearchResult:
        """Return the SearchResult; arguments replace the search's own groups.

        ``limits``: (lower, upper) in place of the chain's; ``postures``: (seed, preferred); ``rows``: the Rows of the
        error that count.
        """
        q = np.empty(len(self.chain))
        target = self.target.arrays
        if rows is not None:
            target = (*target[:2], rows.value, target[3])
        arrived, starts, iterations, error_m, error_rad = kernels.search(
            self.chain.arrays, limits or self.chain.limit_arrays, target, (budget or self.budget).effort,
            postures or (self.seed, self.preferred), q)
        return SearchResult(arrived, starts, iterations, error_m, error_rad, q)

    def newton(self) -> SearchResult:
        """Return the SearchResult of plain Newton steps from the seed, as the vendor's simulator makes them;
        ``arrived`` is 1 or 0."""
        q = np.empty(len(self.chain))
        steps, arrived = kernels.newton(self.chain.arrays, self.chain.limit_arrays, self.target.arrays,
                                        self.budget.effort, self.seed, q)
        return SearchResult(int(arrived), 1, steps, *self.residual(q), q)

    def gather(self, solutions: np.ndarray, collection: Collection, *, budget: Budget | None = None,
               limits: Limits | None = None) -> tuple[int, int, int]:
        """Fill rows of ``solutions`` (m, n) with different solutions, as a :class:`Collection` describes.

        Returns (rows filled, starts used, iterations).
        """
        return kernels.gather(self.chain.arrays, limits or self.chain.limit_arrays, self.target.arrays,
                              (budget or self.budget).effort, (self.seed, self.preferred), tuple(collection), solutions)

    def residual(self, q: np.ndarray) -> tuple[float, float]:
        """Return the pose error of ``q`` (n,): [m], [rad]."""
        return kernels.pose_error(self.chain.arrays, self.target.arrays, q)

    def nearest(self) -> tuple[np.ndarray, float, float]:
        """Return (q, error [m], error [rad]): inside the limits, with the tip as near to the target as possible."""
        q = np.empty(len(self.chain))
        errors = kernels.nearest(self.chain.arrays, self.chain.limit_arrays, self.target.arrays, _NEAREST.effort,
                                 METRES_PER_RADIAN, self.seed, q)
        return (q, *errors)

    def free_limits(self, joint: int | None = None, by: float = math.inf) -> Limits:
        """Return (lower, upper) with the limits of ``joint`` (index), or of all, moved outwards by ``by`` [rad or
        m]."""
        lower, upper = (limit.copy() for limit in self.chain.limit_arrays)
        which = slice(None) if joint is None else joint
        lower[which] -= by
        upper[which] += by
        return lower, upper
