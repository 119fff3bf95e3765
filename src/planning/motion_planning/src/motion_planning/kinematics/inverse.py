# SPDX-License-Identifier: BSD-3-Clause
"""Inverse kinematics of groups."""
from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from command_line.options import counted
from motion_planning.kinematics.limb import KinematicsFailure, NoIkSolution, limbs_of
from motion_planning.model import Group, ModelError, State

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from arm_kinematics import Target
    from motion_planning.kinematics import GroupLimb
    from motion_planning.model import PlanningModel

#: Number of solutions of each limb to combine before the search restarts from another seed.
_SEVERAL = 12


def fk(model: PlanningModel, q: ArrayLike, links: Iterable[str],
       base: np.ndarray | None = None) -> dict[str, np.ndarray]:
    """Return {link: pose (4, 4) in the planning frame} of ``links`` at ``q`` (n,).

    ``base`` (4, 4): the root in the planning frame, None: identity. Raises ModelError for an unknown link.
    """
    unknown = [link for link in links if link not in model.link_index]
    if unknown:
        raise ModelError("robot '%s' has no link '%s'" % (model.name, unknown[0]))
    frames = model.frames(q, base)
    return {link: frames[model.link_index[link]] for link in links}


def ik(model: PlanningModel, group: Group | str, poses: Mapping[str, np.ndarray], seed: State | ArrayLike,
       timeout_s: float = 0.05, accept: Callable[[np.ndarray], str | None] | None = None,
       clock: Callable[[], float] = time.monotonic) -> np.ndarray:
    """Return ``q`` (n,) that puts links at the given poses; only the joints of ``group`` differ from the seed.

    group: a Group or its name. poses: {link: pose (4, 4), or position (3,) for any orientation}, in the planning frame;
    several links if they share no joints, such as both hands. seed: a State, or q (n,) with the root in the origin; the
    solution nearest to it is returned. timeout_s: time limit for further solutions after ``accept`` has refused one.
    accept: function of q (n,) that returns None, or the reason why q is not acceptable. Raises NoIkSolution with the
    reason; KinematicsFailure for links that the group cannot move; ModelError.
    """
    deadline = clock() + timeout_s
    group = group if isinstance(group, Group) else model.group(group)
    state = seed if isinstance(seed, State) else model.state(np.asarray(seed, dtype=np.float64))
    if not poses:
        raise KinematicsFailure("no link of group '%s' is to be put anywhere" % group.name)
    limbs = limbs_of(model, group, list(poses))
    frames = model.frames(state.q, state.base)
    targets = [limb.target(poses[limb.link], frames[model.link_index[limb.base]]) for limb in limbs]
    q = _put(model, state.q, limbs, [limb.nearest(target, _seed_of(limb, state.q))
                                     for limb, target in zip(limbs, targets, strict=True)])
    if accept is None:
        return q
    refusal = accept(q)
    if refusal is None:
        return q
    return _search(model, state.q, (limbs, targets), accept, (refusal, deadline, clock))


def _search(model: PlanningModel, start: np.ndarray, problem: tuple[list[GroupLimb], list[Target]],
            accept: Callable[[np.ndarray], str | None], progress: tuple[str, float, Callable[[], float]]) -> np.ndarray:
    """Return the first other solution that ``accept`` accepts: near ones first, then from random postures until the
    deadline."""
    limbs, targets = problem
    refusal, deadline, clock = progress
    generator, tried, around = np.random.default_rng(0), 1, start
    while True:
        found = [limb.several(target, _seed_of(limb, around), _SEVERAL)
                 for limb, target in zip(limbs, targets, strict=True)]
        together = sorted(product(*found), key=lambda parts: sum(
            float(np.sum((part - start[limb.indices]) ** 2)) for limb, part in zip(limbs, parts, strict=True)))
        for parts in together:
            q = _put(model, start, limbs, parts)
            refused = accept(q)
            if refused is None:
                return q
            tried += 1
            if clock() >= deadline:
                break
        if clock() >= deadline:
            raise NoIkSolution("%s were found and refused, the nearest because %s" % (counted(tried, "solution"),
                                                                                      refusal), True)
        around = generator.uniform(model.bounds[:, 0], model.bounds[:, 1])


def _seed_of(limb: GroupLimb, q: np.ndarray) -> np.ndarray:
    return np.clip(q[limb.indices], limb.chain.lower, limb.chain.upper)


def _put(model: PlanningModel, q: np.ndarray, limbs: Sequence[GroupLimb], parts: Sequence[np.ndarray]) -> np.ndarray:
    """Return ``q`` (n,) with each limb's part (k,) inserted; continuous joints are wrapped to -pi to pi."""
    whole = np.array(q)
    for limb, part in zip(limbs, parts, strict=True):
        whole[limb.indices] = part
    return model.wrapped(whole)
