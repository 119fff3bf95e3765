# SPDX-License-Identifier: BSD-3-Clause
"""Diagnose why a pose has no solution: after a failed search, search again with one constraint removed."""
from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from arm_kinematics import kernels
from arm_kinematics.budget import MAX_ITERATIONS, MAX_STARTS
from arm_kinematics.errors import Attempt, NoSolution, Reason
from arm_kinematics.kernels import Rows
from arm_kinematics.search import Collection
from command_line.options import counted

if TYPE_CHECKING:
    from arm_kinematics.budget import Budget
    from arm_kinematics.chain import Chain
    from arm_kinematics.search import Search, SearchResult
    from arm_kinematics.target import Target

# If the pose error stays above this without limits, more iterations will not help [m or rad].
_CLEARLY_OFF = 1e-4
# Starts of a diagnosis, which is easier than the search.
_STARTS_TO_EXPLAIN = 60
# A better joint must be found within this share of the previous joint's excess.
_SHORTER = 0.95
# Number of walks towards the limit that a joint exceeds; each covers about half of the remaining distance.
_PULLS = 5
# Number of solutions without limits, among which the one with the least excess is chosen.
_UNLIMITED = 48
# A target that is so many times as far away as the arm is long was probably meant in other units.
_OTHER_UNITS = 10.0


def beyond_reach(chain: Chain, target: Target) -> str:
    """Return a sentence if the target lies outside a ball that the arm cannot leave, or "" if it lies inside.

    With the orientation given, the origin of a last revolute joint is known, so there is a ball for that as well.
    """
    over, wrist_over = kernels.beyond_reach(target.rotation, target.position, chain.shoulder, chain.tip_reach_m,
                                            chain.wrist_in_tip, chain.wrist_reach_m)
    text = "the target lies at least %.3f m beyond the outstretched arm; move it"
    if over <= 0.0 and chain.wrist_is_fixed and target.rows is Rows.POSE:
        over = wrist_over
        text = "in this orientation the wrist would have to be at least %.3f m beyond the outstretched arm; turn the " \
            "target or move it"
    if over <= 0.0:
        return ""
    if over > _OTHER_UNITS * chain.tip_reach_m:
        text = "positions are in metres: " + text
    return (text + " towards the shoulder at (%.3f %.3f %.3f) in %s") % (over, *chain.shoulder, chain.base)


def explain(search: Search, found: SearchResult) -> SearchResult:
    """Raise the NoSolution that explains why ``search`` failed with ``found``.

    Returns a solution if the diagnosis happens to find one.
    """
    chain, target = search.chain, search.target
    reach = beyond_reach(chain, target)
    if reach:
        raise _out_of_reach(search, reach)
    budget = search.budget
    if budget.max_starts < MAX_STARTS or budget.max_iterations < MAX_ITERATIONS:
        full = search.run(budget=_budget(search, MAX_STARTS))
        if full.arrived:
            raise _failure(search, Reason.NOT_CONVERGED, "no start out of %d came within the tolerance after %d "
                           "iterations from this seed; allow more" % (budget.max_starts, budget.max_iterations),
                           (found.q, found.residual_m, found.residual_rad))
    lifted = search.run(budget=_budget(search, MAX_STARTS), limits=search.free_limits(), postures=(found.q, found.q))
    if lifted.arrived:
        inside, over = _least_excess(search, found.q, lifted.q)
        inside = inside or (None if over else _settled(search, lifted.q))
        if inside:
            return inside
        named = sorted(over, key=lambda name: -abs(over[name]))
        sentences = ", ".join(_excess_sentence(chain, name, over[name]) for name in named)
        raise _failure(search, Reason.JOINT_LIMIT, "%s; change the orientation or bring the target nearer to the "
                       "middle of the workspace" % sentences, search.nearest(), joints=named,
                       excess=[abs(over[name]) for name in named])
    if max(lifted.residual_m, 0.0 if target.rows is Rows.POSITION else lifted.residual_rad) > _CLEARLY_OFF:
        if target.rows is not Rows.POSITION and search.run(budget=_budget(search, _STARTS_TO_EXPLAIN),
                                                               rows=Rows.POSITION).arrived:
            raise _out_of_reach(search, "the point can be reached, but not in this orientation; turn the target or "
                                "move it into the workspace")
        raise _out_of_reach(search, "the arm does not get there even without its joint limits; move the target into "
                            "the workspace")
    raise _failure(search, Reason.NOT_CONVERGED, "%s came close but none within the tolerance; the target is at "
                   "the edge of the workspace or near a singularity, move it a little or try another seed"
                   % counted(found.starts, "start"), (found.q, found.residual_m, found.residual_rad))


def _budget(search: Search, starts: int) -> Budget:
    """The search's tolerances, one solution, and the default number of iterations."""
    return replace(search.budget, candidates=1, max_starts=starts, max_iterations=MAX_ITERATIONS)


def _out_of_reach(search: Search, detail: str) -> NoSolution:
    return _failure(search, Reason.OUT_OF_REACH, detail, search.nearest())


def _failure(search: Search, reason: Reason, detail: str, nearest: tuple[np.ndarray, float, float],
             joints: Iterable[str] = (), excess: Iterable[float] = ()) -> NoSolution:
    q, residual_m, residual_rad = nearest
    attempt = Attempt(q, search.chain.fk(q), residual_m, residual_rad)
    return NoSolution(search.target.pose, reason, detail, attempt, joints=joints, excess=excess)


def _least_excess(search: Search, start: np.ndarray, lifted: np.ndarray) -> tuple[SearchResult | None,
                                                                                  dict[str, float]]:
    """Return (a solution inside the limits or None, {joint name: signed excess} of the joints that must exceed their
    limits).

    One joint alone if that is enough, the one with the least excess; else several together. ``lifted``: a solution
    without limits.
    """
    chain = search.chain
    least, bound = {}, math.inf
    for joint in range(len(chain)):
        # A joint that fails within one bound also fails within a tighter one, so each fails only once.
        while True:
            inside, over = _alone(search, joint, bound, start)
            if inside is not None:
                return inside, {}
            if not over:
                break
            least, bound = over, _SHORTER * _sum(over)
    if not least:
        solutions = np.empty((_UNLIMITED, len(chain)))
        solutions[0] = lifted
        count, _, _ = search.gather(solutions, Collection(held=1), limits=search.free_limits(),
                                    budget=replace(search.budget, max_starts=MAX_STARTS))
        least = min(filter(None, (_excess(chain, q) for q in solutions[:count])), key=_sum, default={})
    return None, least


def _alone(search: Search, joint: int, bound: float, start: np.ndarray) -> tuple[SearchResult | None, dict[str, float]]:
    """Return (a solution inside the limits or None, {name of joint number ``joint``: signed excess}, empty if it fails
    within ``bound`` [rad or m] beyond its limits).
    """
    chain, limits = search.chain, search.free_limits(joint, bound)
    found = search.run(budget=_budget(search, _STARTS_TO_EXPLAIN), limits=limits, postures=(start, start))
    if not found.arrived:
        return None, {}
    for _ in range(_PULLS):
        # Walk along the self-motion to the least excess of this joint.
        wrapped = _wrapped(chain, found.q)
        found = search.run(budget=_budget(search, 1), limits=limits,
                           postures=(wrapped, np.clip(wrapped, *chain.limit_arrays)))
    over = _excess(chain, found.q)
    return (None if over else _settled(search, found.q)), over


def _sum(over: dict[str, float]) -> float:
    return sum(map(abs, over.values()))


def _settled(search: Search, q: np.ndarray) -> SearchResult | None:
    """Return the SearchResult of a search from ``q``, wrapped into the limits, if it arrives; else None."""
    start = np.clip(_wrapped(search.chain, q), *search.chain.limit_arrays)
    inside = search.run(budget=_budget(search, 1), postures=(start, search.preferred))
    return inside if inside.arrived else None


def _wrapped(chain: Chain, q: np.ndarray) -> np.ndarray:
    """Turn revolute joints by whole turns into their limits, or to the least excess."""
    lower, upper = chain.limit_arrays
    turns = np.round((q - chain.mid_range) / (2.0 * math.pi))
    return np.where(chain.arrays[2] | ~np.isfinite(lower) | ~np.isfinite(upper), q, q - 2.0 * math.pi * turns)


def _excess(chain: Chain, q: np.ndarray) -> dict[str, float]:
    """Return {joint name: excess beyond its limit [rad or m], negative below the lower one} of ``q`` modulo whole
    turns.
    """
    over = {}
    for name, value, low, high in zip(chain.joint_names, _wrapped(chain, q), *chain.limit_arrays, strict=True):
        if not low - 1e-9 <= value <= high + 1e-9:
            over[name] = float(value - (low if value < low else high))
    return over


def _excess_sentence(chain: Chain, name: str, excess: float) -> str:
    joint = chain.joint_names.index(name)
    side, limit = ("lower", chain.lower[joint]) if excess < 0.0 else ("upper", chain.upper[joint])
    return "%s would have to go to %.3f %s, its %s limit is %.3f" % (
        name, limit + excess, "m" if chain.arrays[2][joint] else "rad", side, limit)
