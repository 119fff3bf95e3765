# SPDX-License-Identifier: BSD-3-Clause
"""Inverse kinematics: from a pose of the tip to joint values inside the limits, or to the reason why there are none."""
import math

import numpy as np

from baxter_sim_kinematics import kernels
from baxter_sim_kinematics.collision import first_free
from baxter_sim_kinematics.search import APART, MAX_ITERATIONS, MAX_STARTS, IkResult, Search
from baxter_sim_kinematics.target import Target
from baxter_sim_kinematics.verdict import beyond_reach, explain


def solve(chain, target, seed, tolerance_m=1e-6, tolerance_rad=1e-6, position_only=False, candidates=2,
          max_starts=MAX_STARTS, max_iterations=MAX_ITERATIONS, *, free_axis=None, posture=None, checker=None):
    """Return an :class:`IkResult` whose q puts the tip of ``chain`` on ``target`` (4, 4), tip in base [m].

    Damped least squares, started at ``seed`` (n,) and then at random postures until ``candidates`` of the starts have
    arrived. Where the arm has more joints than the pose needs, each solution is then moved along its self-motion to the
    point nearest ``posture`` (n,), which is the seed unless given (least squares over the joints); the nearest of all
    is returned. Two candidates cost about 0.06 ms on a 7-joint arm and are the nearest there is three times out of
    four, 32 cost 1 ms and miss 1 in 100.

    Joint limits are never broken; a seed outside of them is clamped. The random postures are seeded by the request
    itself: the same request gives the same answer bit for bit.

    position_only: any orientation will do. free_axis (3,): any turn about this axis of the tip will do, e.g. (0, 0, 1)
    for a gripper that may come from any side. checker: a :class:`CollisionChecker`; postures that touch are no
    solutions.

    Raises NoSolution, which says why; InvalidTarget; InvalidPosture for a seed or posture that does not fit the chain.
    """
    search = _search(chain, target, seed, posture, tolerance_m, tolerance_rad, position_only, free_axis, max_starts,
                     max_iterations)
    if not 1 <= candidates < math.inf:
        raise ValueError("candidates must be finite and at least 1, got %r" % (candidates,))
    starts = 1 if beyond_reach(chain, search.target) else search.max_starts
    found = search.run(int(candidates), starts, search.max_iterations)
    if not found.arrived:
        found = explain(search, found)
    if checker is not None:
        return first_free(search, found, checker)
    return IkResult(found.q, found.residual_m, found.residual_rad, found.iterations, found.starts - 1)


def solve_all(chain, target, seed, n_solutions, tolerance_m=1e-6, tolerance_rad=1e-6, position_only=False,
              max_starts=MAX_STARTS, max_iterations=MAX_ITERATIONS, *, free_axis=None, posture=None, checker=None,
              settle=True, apart=APART):
    """Return up to ``n_solutions`` distinct solutions of :func:`solve`'s problem, as a list of IkResult.

    Nearest to ``posture`` (or the seed) first, each at least ``apart`` [rad or m] from every other in some joint. An
    arm with more joints than the pose needs has whole curves of them: with ``settle`` each is moved to the nearest
    point of its curve, so that an answer is one for each way to hold the arm; without, the answers are spread along
    the curves. Fewer come back where ``max_starts`` starts find no more. Raises as :func:`solve` does where there is
    not one.
    """
    search = _search(chain, target, seed, posture, tolerance_m, tolerance_rad, position_only, free_axis, max_starts,
                     max_iterations)
    if not 1 <= n_solutions < math.inf:
        raise ValueError("n_solutions must be finite and at least 1, got %r" % (n_solutions,))
    if not apart >= 0.0:
        raise ValueError("apart must be 0 or more, got %r" % (apart,))
    # All that there are, so that the nearest are among those kept; a spread answer is as long as the caller asks.
    rows = np.empty((max(int(n_solutions), search.max_starts if settle or checker else 0), len(chain)))
    count, starts, iterations = (0, 1, 0) if beyond_reach(chain, search.target) else search.gather(
        rows, 0, 0, bool(settle), apart=apart)
    if not count:
        rows[0] = solve(chain, target, seed, tolerance_m, tolerance_rad, position_only, 1, max_starts, max_iterations,
                        free_axis=free_axis, posture=posture).q
        count = 1
    nearest_first = rows[np.argsort(np.linalg.norm(rows[:count] - search.goal, axis=1), kind="stable")]
    if checker is not None:
        free = [q for q in nearest_first if checker.contact(chain.joint_names, q) is None]
        if not free:
            free = [solve(chain, target, seed, tolerance_m, tolerance_rad, position_only, 1, max_starts, max_iterations,
                          free_axis=free_axis, posture=posture, checker=checker).q]
        nearest_first = np.array(free)
    results = []
    for q in nearest_first[:int(n_solutions)]:
        results.append(IkResult(q.copy(), *search.residual(q), iterations, starts - 1))
    return results


def _search(chain, target, seed, posture, tolerance_m, tolerance_rad, position_only, free_axis, max_starts,
            max_iterations):
    seed = chain.posture(seed)
    goal = seed if posture is None else chain.posture(posture)
    return Search(chain, Target(target, position_only, free_axis), seed, goal, tolerance_m, tolerance_rad, max_starts,
                  max_iterations)


def warm_up(chain):
    """Compile, or load from the cache, everything that ``chain`` and :func:`solve` need, by using it once."""
    pose, jacobian = chain.fk_and_jacobian(chain.mid_range)
    chain.link_frames(chain.mid_range)
    kernels.wrench(jacobian, chain.mid_range, 0.01)
    solve(chain, pose, chain.mid_range)
    solve_all(chain, pose, chain.mid_range, 1)
    Search(chain, Target(pose), chain.mid_range, chain.mid_range, 1e-3, 1e-3).nearest()
