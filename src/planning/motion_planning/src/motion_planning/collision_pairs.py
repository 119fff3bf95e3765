# SPDX-License-Identifier: BSD-3-Clause
"""Pairs of links that need no collision check, found from random states of the robot."""
from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from motion_planning.exact import ExactChecker
from motion_planning.model.planning_model import pair_of
from motion_planning.scene import AllowedCollisions, Scene
from motion_planning.srdf import DisabledPair

if TYPE_CHECKING:
    from numpy.random import Generator as Random

    from motion_planning.model import PlanningModel
    from motion_planning.shapes import Meshes

#: Number of random states for pairs that always touch, and the share of contacts that counts as always; as in MoveIt's
#: setup assistant.
ALWAYS_STATES, ALWAYS_SHARE = 200, 0.95
#: Number of random states for pairs that never touch.
TRIALS = 10_000
# The first reason that applies is written.
_REASONS = ("User", "Adjacent", "Default", "Always", "Never")


def disabled_pairs(model: PlanningModel, meshes: Meshes, *, trials: int = TRIALS, share: float = ALWAYS_SHARE,
                   seed: int = 0) -> list[DisabledPair]:
    """Return [DisabledPair, ...] of ``model``, sorted by names; pairs that its SRDF disables for reason "User" are
    kept.

    ``meshes``: as of ExactChecker. A pair is disabled when its links are neighbours, over joints and over links without
    a shape (Adjacent); when they touch with all joints at 0 or in the middle (Default); in the ``share`` of
    ALWAYS_STATES random states (Always); or in none of ``trials`` random states (Never). ``seed``: of these states.
    """
    exact = ExactChecker(model, meshes)
    generator = np.random.default_rng(seed)
    shaped = [name for name in model.links if model.robot.links[name].collisions]
    reasons = {pair_of(pair.link1, pair.link2): "User" for pair in model.srdf.disabled if pair.reason == "User"}
    reasons.update({pair: "Adjacent" for pair in adjacent_pairs(model) if pair not in reasons})

    def touching(q: np.ndarray) -> list[tuple[str, str]]:
        scene = Scene(model, allowed=AllowedCollisions(dict.fromkeys(reasons, True)))
        return [pair_of(one.a, one.b) for one in exact.contacts(scene, scene.state.with_q(q), most=len(shaped) ** 2)]

    reasons.update(dict.fromkeys(touching(model.default_state().q), "Default"))
    while True:
        times = Counter(pair for q in _random(model, generator, ALWAYS_STATES) for pair in touching(q))
        always = [pair for pair, count in times.items() if count >= share * ALWAYS_STATES]
        reasons.update(dict.fromkeys(always, "Always"))
        if not always:
            break
    scene = Scene(model, allowed=AllowedCollisions(dict.fromkeys(reasons, True)))
    seen = set(times)
    for q in _random(model, generator, trials):
        seen.update(pair_of(one.a, one.b) for one in exact.contacts(scene, scene.state.with_q(q),
                                                                    most=len(shaped) ** 2))
    for pair in combinations(sorted(shaped), 2):
        if pair not in seen:
            reasons.setdefault(pair, "Never")
    return [DisabledPair(*pair, reason) for pair, reason in sorted(reasons.items())]


def adjacent_pairs(model: PlanningModel) -> set[tuple[str, str]]:
    """Return {sorted pair, ...} of links with shapes that are neighbours: over one joint, or over links without one."""
    near = {name: set() for name in model.links}
    for joint in model.robot.joints.values():
        near[joint.parent].add(joint.child)
        near[joint.child].add(joint.parent)
    for name in model.links:
        if not model.robot.links[name].collisions:
            around = near.pop(name)
            for one in around:
                near[one].discard(name)
                near[one] |= around - {one}
    return {pair_of(a, b) for a, others in near.items() for b in others}


def summary(pairs: Sequence[DisabledPair]) -> str:
    """Return the number of ``pairs`` (DisabledPair) for each reason, as one line."""
    counts = Counter(pair.reason for pair in pairs)
    return "%d pairs: %s" % (len(pairs), ", ".join("%d %s" % (counts[reason], reason) for reason in _REASONS
                                                   if counts[reason]))


def _random(model: PlanningModel, generator: Random, count: int) -> np.ndarray:
    return generator.uniform(model.bounds[:, 0], model.bounds[:, 1], (count, len(model.variables)))
