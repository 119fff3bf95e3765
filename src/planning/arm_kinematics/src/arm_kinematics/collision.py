# SPDX-License-Identifier: BSD-3-Clause
"""Inverse kinematics that avoids collisions with the robot's own body and the world."""
from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

from arm_kinematics.chain import Chain
from arm_kinematics.errors import Attempt, NoSolution, Reason
from arm_kinematics.search import Collection, IkResult
from command_line.options import counted

if TYPE_CHECKING:
    from arm_kinematics.search import Search, SearchResult

# Number of solutions checked between two searches; the first ones are mostly free.
_CHUNK = 6


class Touch(NamedTuple):
    """Two links that touch. link_a is the robot's; link_b too, or "model/link" of something in the world."""

    link_a: str
    link_b: str
    with_world: bool
    depth_m: float


class CollisionChecker(Protocol):
    """Checks whether a posture touches anything. Not thread-safe unless its class says so."""

    def contact(self, joint_names: Sequence[str], q: np.ndarray) -> Touch | None:
        """Return the deepest Touch of the robot with its ``joint_names`` at ``q``, or None where it is clear."""
        ...


class OwnBody:
    """Whether a robot can be in a posture, as far as its own body is concerned: nothing of it touches, and it is not
    where its own collision avoidance holds the arm.

    chain: of the arm; balls: [(link, centre (3,) [m], distance [m])] as of ``baxter_model.description.avoided_balls``;
    first: joint from which on the arm's middle line is kept so far from the centres, counted from 0; checker: a
    CollisionChecker.
    """

    def __init__(self, chain: Chain, balls: list, first: int, checker: CollisionChecker) -> None:
        self._chain, self._first, self._checker = chain, first, checker
        self._centres = np.array([centre for _, centre, _ in balls]).reshape(-1, 1, 3)
        self._distances = np.array([distance for _, _, distance in balls])

    def __call__(self, q: np.ndarray) -> bool:
        return not self._is_held(q) and self._checker.contact(self._chain.joint_names, q) is None

    def _is_held(self, q: np.ndarray) -> bool:
        origins = self._chain.joint_frames(q)[1][self._first:]
        begins, steps = origins[:-1], np.diff(origins, axis=0)
        lengths = np.maximum((steps ** 2).sum(axis=1), 1e-12)
        shares = np.clip(((self._centres - begins) * steps).sum(axis=2) / lengths, 0.0, 1.0)
        gaps = np.linalg.norm(begins + shares[..., None] * steps - self._centres, axis=2).min(axis=1, initial=np.inf)
        return bool((gaps < self._distances).any())


def first_free(search: Search, found: SearchResult, checker: CollisionChecker) -> IkResult:
    """Return the IkResult of ``found`` if it has no contact, else of the solution without contact that is nearest to
    the preferred posture, among the first ones found.

    Raises NoSolution, which names the pair that touches in most solutions, after all starts of ``search``'s budget.
    """
    names = search.chain.joint_names
    touch = checker.contact(names, found.q)
    if touch is None:
        return IkResult(found.q, found.residual_m, found.residual_rad, found.iterations, found.starts - 1)
    touches = Counter([touch[:3]])
    solutions = np.empty((int(search.budget.max_starts) + 1, len(search.chain)))
    solutions[0] = found.q
    held, start, iterations = 1, 0, found.iterations
    while start < search.budget.max_starts:
        room = solutions[: min(held + _CHUNK, len(solutions))]
        count, used, more = search.gather(room, Collection(held, start, settle=False))
        start, iterations = start + used, iterations + more
        new = solutions[held:count]
        held = count
        for q in new[np.argsort(np.linalg.norm(new - search.preferred, axis=1), kind="stable")]:
            touch = checker.contact(names, q)
            if touch is None:
                return IkResult(q.copy(), *search.residual(q), iterations, start - 1)
            touches[touch[:3]] += 1
        if not used:
            break
    (link_a, link_b, with_world), times = touches.most_common(1)[0]
    reason = Reason.WORLD_COLLISION if with_world else Reason.SELF_COLLISION
    raise NoSolution(
        search.target.pose, reason, "%s touches %s in %d of the %s that reach the pose, and none of them is "
        "clear; move the target or turn it" % (link_a, link_b, times, counted(sum(touches.values()), "posture")),
        Attempt(found.q, search.chain.fk(found.q), found.residual_m, found.residual_rad), pair=(link_a, link_b))
