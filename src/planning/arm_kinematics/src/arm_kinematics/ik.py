# SPDX-License-Identifier: BSD-3-Clause
"""Inverse kinematics: from a pose of the tip to joint values inside the limits, or to the reason why none exist."""
from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from arm_kinematics import kernels
from arm_kinematics.budget import USUAL
from arm_kinematics.collision import first_free
from arm_kinematics.diagnosis import beyond_reach, explain
from arm_kinematics.errors import NoSolution
from arm_kinematics.search import APART, Collection, IkResult, Search
from arm_kinematics.target import Target

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from arm_kinematics.budget import Budget
    from arm_kinematics.chain import Chain
    from arm_kinematics.collision import CollisionChecker

# A quarter turn more than needed [rad] is another arm configuration: of such answers (from neutral, 829 poses) nine in
# ten are on another curve of self-motion than the nearest solution. Near neutral, one answer in twenty is of that kind.
MAX_DETOUR_RAD = math.pi / 2


def solve(chain: Chain, target: Target | ArrayLike, seed: ArrayLike, *, posture: ArrayLike | None = None,
          budget: Budget = USUAL, checker: CollisionChecker | None = None) -> IkResult:
    """Return an :class:`IkResult` whose q puts the tip of ``chain`` on ``target``.

    ``target``: a :class:`Target`, or the pose (4, 4), tip in base [m], all six components. ``seed`` (n,): where
    the search starts. ``budget``: a :class:`Budget`.

    Damped least squares, started at ``seed`` and then at random postures until the budget's number of starts has
    arrived. If the arm has more joints than the pose needs, each solution is then moved along its self-motion to the
    point nearest ``posture`` (n,), which is the seed unless given (least squares over the joints); the nearest of all
    is returned. Joint limits are never broken; a seed outside of them is clamped. The random postures depend only on
    the request, so the same request gives the same answer bit for bit.

    checker: a :class:`CollisionChecker`; postures with contacts are not solutions.

    Raises NoSolution, which says why; InvalidTarget; InvalidPosture for a seed or posture that does not fit the chain.
    """
    search = Search(chain, Target.of(target), seed, posture, budget)
    found = search.run(budget=replace(budget, max_starts=1) if beyond_reach(chain, search.target) else budget)
    if not found.arrived:
        found = explain(search, found)
    if checker is not None:
        return first_free(search, found, checker)
    return IkResult(found.q, found.residual_m, found.residual_rad, found.iterations, found.starts - 1)


def solve_as_vendor(chain: Chain, target: Target | ArrayLike, seed: ArrayLike, *, budget: Budget = USUAL,
                    checker: CollisionChecker | None = None,
                    is_possible: Callable[[np.ndarray], bool] = lambda q: True) -> IkResult:
    """Return the IkResult that the vendor's simulator answers with, made exact: where plain Newton steps from ``seed``
    lead. Where they lead nowhere, into contact, to a posture that is not possible, or far round, the one of
    :func:`solve`.

    The steps are those of KDL's ChainIkSolverPos_NR_JL, a thousand of them, until every component of the pose error is
    below 0.01 [m], [rad]. Far round: some joint turns by more than MAX_DETOUR_RAD farther than for the nearest
    solution, if that is possible. ``is_possible``: function of a posture (n,), whether the robot can be there, such as
    :class:`OwnBody`. Other arguments, and errors, are those of :func:`solve`.
    """
    search = Search(chain, Target.of(target), seed, None, budget)
    found = None if beyond_reach(chain, search.target) else search.newton()
    if found is None or not found.arrived or not is_possible(found.q) or (
            checker is not None and checker.contact(chain.joint_names, found.q) is not None):
        return solve(chain, search.target, seed, budget=budget, checker=checker)
    answer = IkResult(found.q, found.residual_m, found.residual_rad, found.iterations, 0)
    if np.abs(found.q - search.seed).max() <= MAX_DETOUR_RAD:
        return answer  # no solution is nearer by more
    try:
        nearest = solve(chain, search.target, seed, budget=budget, checker=checker)
    except NoSolution:
        return answer
    detour = np.abs(found.q - search.seed) - np.abs(nearest.q - search.seed)
    return nearest if detour.max() > MAX_DETOUR_RAD and is_possible(nearest.q) else answer


@dataclass(frozen=True)
class Several:
    """How many solutions :func:`solve_all` returns, and which.

    An arm with more joints than the pose needs has whole curves of solutions: with ``settle`` each solution is moved to
    the nearest point of its curve, so that there is one for each arm configuration; without, they are spread along the
    curves. ``apart``: least difference in some joint [rad or m] between any two solutions.

    Raises ValueError for a number that is not finite or below 1, and for a negative distance.
    """

    number: int
    settle: bool = True
    apart: float = APART

    def __post_init__(self) -> None:
        if not 1 <= self.number < math.inf:
            raise ValueError("the number of solutions must be finite and at least 1, got %r" % (self.number,))
        if not self.apart >= 0.0:
            raise ValueError("apart must be 0 or more, got %r" % (self.apart,))


def solve_all(chain: Chain, target: Target | ArrayLike, seed: ArrayLike, wanted: Several | int, *,
              posture: ArrayLike | None = None, budget: Budget = USUAL,
              checker: CollisionChecker | None = None) -> list[IkResult]:
    """Return distinct solutions of :func:`solve`'s problem, as a list of IkResult, nearest to ``posture`` first.

    ``wanted``: :class:`Several`, or the most solutions to return. Returns fewer if the budget's starts find no more;
    its ``candidates`` are not used. Raises as :func:`solve` if there is no solution.
    """
    wanted = wanted if isinstance(wanted, Several) else Several(wanted)
    search = Search(chain, Target.of(target), seed, posture, budget)
    # Collect all solutions, so that the nearest are kept; a spread answer is as long as the caller requests.
    rows = np.empty((max(int(wanted.number), int(budget.max_starts) if wanted.settle or checker else 0), len(chain)))
    count, starts, iterations = (0, 1, 0) if beyond_reach(chain, search.target) else search.gather(
        rows, Collection(settle=bool(wanted.settle), apart=float(wanted.apart)))
    one = replace(budget, candidates=1)
    if not count:
        rows[0] = solve(chain, search.target, seed, posture=posture, budget=one).q
        count = 1
    distances = np.linalg.norm(rows[:count] - search.preferred, axis=1)
    nearest_first = rows[np.argsort(distances, kind="stable")]
    if checker is not None:
        free = [q for q in nearest_first if checker.contact(chain.joint_names, q) is None]
        if not free:
            free = [solve(chain, search.target, seed, posture=posture, budget=one, checker=checker).q]
        nearest_first = np.array(free)
    results = []
    for q in nearest_first[:int(wanted.number)]:
        results.append(IkResult(q.copy(), *search.residual(q), iterations, starts - 1))
    return results


def warm_up(chain: Chain) -> None:
    """Compile, or load from the cache, everything that ``chain`` and :func:`solve` need, by using it once."""
    pose, jacobian = chain.fk_and_jacobian(chain.mid_range)
    chain.link_frames(chain.mid_range)
    kernels.wrench(jacobian, chain.mid_range, 0.01)
    solve_as_vendor(chain, pose, chain.mid_range)
    solve(chain, pose, chain.mid_range)
    solve_all(chain, pose, chain.mid_range, 1)
    Search(chain, Target(pose), chain.mid_range, None, USUAL).nearest()
