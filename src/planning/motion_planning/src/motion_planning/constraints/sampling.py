# SPDX-License-Identifier: BSD-3-Clause
"""Postures of a group that satisfy constraints."""
from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from motion_planning.constraints import regions
from motion_planning.constraints.manifold import Manifold
from motion_planning.constraints.targets import ConstraintError
from motion_planning.kinematics import KinematicsFailure, NoIkSolution, limbs_of

if TYPE_CHECKING:
    from motion_planning.constraints import ConstraintSet
    from motion_planning.constraints.targets import OrientationTarget, PositionTarget
    from motion_planning.exact import ExactChecker
    from motion_planning.kinematics import GroupLimb
    from motion_planning.model import Group, PlanningModel
    from motion_planning.scene import Scene

#: Number of tried postures after which a sampler without a valid one gives up, and greatest number of postures that it
#: yields.
_FRUITLESS, _MOST = 200, 200
# Number of failures of inverse kinematics in a row after which it gives up; fewer if the tolerances are so small that
# the next pose is the same again.
_FAILED_POSES, _FAILED_POSES_IF_ONE = 60, 2
# If tolerances leave less than this [rad or m], another sample is the same one again.
_ONE = 2e-3
_SOLUTIONS = 8
# Postures that differ by less in every joint count as the same [rad or m].
_SAME = 1e-3
# A goal may be given at a limit, and be rounded beyond it [rad or m].
_AT_LIMIT = 1e-6


def sampler(model: PlanningModel, group: str, constraints: ConstraintSet, scene: Scene, exact: ExactChecker | None,
            seed: int, stop: Callable[[], bool] | None = None) -> Sampler:
    """Return a :class:`Sampler`. group: name. Raises ConstraintError and ModelError for unknown names."""
    return Sampler((model, model.group(group), constraints.resolved(scene)), scene, exact, seed, stop)


class Sampler:
    """Iterator of postures (k,) of a group that satisfy constraints and limits and, with ``exact``, are free of
    collisions.

    The first ones are near the scene's state. It ends if there are no more, if none is found, or if ``stop()`` is true.
    reason: why it ended without one, or early; else None.
    """

    def __init__(self, problem: tuple[PlanningModel, Group, ConstraintSet], scene: Scene, exact: ExactChecker | None,
                 seed: int, stop: Callable[[], bool] | None = None) -> None:
        """``problem``: PlanningModel, Group and the resolved ConstraintSet. Raises ConstraintError."""
        self._model, self._group, self._constraints = problem
        self._scene, self._exact, self._stop = scene, exact, stop
        self._generator = np.random.default_rng(seed)
        self._refused, self._unreachable, self.reason, self._given = Counter(), None, None, 0
        self._low, self._high, empty = self._ranges()
        for one in constraints_with_links(self._constraints):
            if one.link not in self._model.link_index:
                raise ConstraintError("a constraint is on link '%s', which is unknown" % one.link)
        self._postures = iter(()) if empty else self._checked()
        self.reason = empty

    def __iter__(self) -> Sampler:
        return self

    def __next__(self) -> np.ndarray:
        q = next(self._postures, None)
        if q is None:
            if self.reason is None and not self._given:
                self.reason = self._why()
            raise StopIteration
        self._given += 1
        return q

    # -- limits and checks --------------------------------------------------------------------------------------

    def _ranges(self) -> tuple[np.ndarray, np.ndarray, str | None]:
        """Least and greatest value (n,) of each joint within limits and joint constraints; the reason if there is
        none."""
        (low, high), named = self._model.bounds.T.copy(), set()
        for one in self._constraints.joints:
            if one.joint not in self._model.index:
                raise ConstraintError("a constraint names joint '%s', which is unknown or cannot be moved"
                                      % one.joint)
            index = self._model.index[one.joint]
            turns = self._model.continuous[index]
            position = math.remainder(one.position, 2.0 * math.pi) if turns else one.position
            least, most = position - one.below, position + one.above
            if turns and one.joint not in named:
                # Beyond half a turn either way it is the same again: postures are wrapped.
                low[index], high[index] = (least, most) if most - least < 2.0 * math.pi else (-math.pi, math.pi)
            elif max(least, low[index]) > min(most, high[index]) + _AT_LIMIT:
                return low, high, ("joint '%s' is to be from %.4f to %.4f, but its limits and the other constraints "
                                   "leave %.4f to %.4f" % (one.joint, least, most, low[index], high[index]))
            else:
                high[index] = min(most, high[index])
                low[index] = min(max(least, low[index]), high[index])
            named.add(one.joint)
        return low, high, None

    def _checked(self) -> Iterator[np.ndarray]:
        """Yield the valid candidates."""
        fruitless = 0
        for q in self._candidates():
            if self._stop is not None and self._stop():
                self.reason = "it was stopped"
                return
            refusal = self._refusal(q)
            if refusal is None:
                fruitless = 0
                yield q[self._group.indices].copy()
                if self._given >= _MOST:
                    return
                continue
            self._refused[refusal] += 1
            fruitless += 1
            if fruitless >= _FRUITLESS:
                return

    def _refusal(self, q: np.ndarray) -> str | None:
        """Return why a posture ``q`` (n,) is not valid, as a kind and an example; None if it is valid."""
        index = self._group.indices
        beyond = self._model.beyond_limits(q, _AT_LIMIT, index)
        if beyond:
            return "joint '%s' would have to be at %.3f, beyond its limits %.3f to %.3f" % beyond[0]
        state = self._scene.state.with_q(q)
        broken = self._constraints.broken(self._model, state, self._scene, self._exact)
        if broken is not None:
            return broken
        if self._exact is not None:
            contacts = self._exact.contacts(self._scene, state, self._group.name, most=1)
            if contacts:
                return "%s '%s' touches '%s'" % (contacts[0].a_kind, contacts[0].a, contacts[0].b)
        return None

    def _why(self) -> str:
        if not self._refused:
            return self._unreachable or "no posture of group '%s' was found" % self._group.name
        (text, times), tried = self._refused.most_common(1)[0], sum(self._refused.values())
        return "none of %d postures will do; %d of them because %s" % (tried, times, text)

    # -- candidates ---------------------------------------------------------------------------------------------

    def _candidates(self) -> Iterator[np.ndarray]:
        """Postures q (n,), most of which satisfy the constraints."""
        if self._constraints.positions or self._constraints.orientations:
            return self._by_kinematics()
        return self._by_joints()

    def _by_joints(self) -> Iterator[np.ndarray]:
        """Within the ranges of the joints: first the middle of constrained joints and the present value of the others;
        then random values."""
        index = self._group.indices
        first = np.clip(self._scene.state.q, self._low, self._high)
        for one in self._constraints.joints:
            k = self._model.index[one.joint]
            if k in index:
                value = one.position
                if self._model.continuous[k]:
                    value = 0.5 * (self._low[k] + self._high[k])
                first[k] = np.clip(value, self._low[k], self._high[k])
        first = self._outside_as_it_is(first)
        yield first
        if (self._high - self._low)[index].max(initial=0.0) < _ONE and not self._constraints.visibilities:
            return
        while True:
            yield self._outside_as_it_is(self._model.wrapped(self._random()))

    def _by_kinematics(self) -> Iterator[np.ndarray]:
        """By inverse kinematics of poses within the tolerances, from the present posture and from random ones."""
        links = list(dict.fromkeys(one.link for one in constraints_with_links(self._constraints)))
        try:
            limbs = self._independent(links)
        except KinematicsFailure as error:
            self.reason = str(error)
            return
        # Other links of the same chains are brought into their constraints by what the chains have left.
        whole = None if len(limbs) == len(links) else Manifold(
            self._scene, self._group, self._constraints, self._scene.state.q[self._group.indices])
        failed, patience = 0, _FAILED_POSES if whole or self._is_wide() else _FAILED_POSES_IF_ONE
        first, known = True, np.empty((0, len(self._group)))
        while failed < patience:
            if self._stop is not None and self._stop():
                self.reason = "it was stopped"
                return
            failed += 1
            for q in self._solutions(limbs, first):
                if whole is not None:
                    q = self._brought(q, whole)
                own = q[self._group.indices]
                if (np.abs(known - own).max(axis=1, initial=0.0) < _SAME).any():
                    continue
                known = np.vstack([known, own])
                failed = 0
                yield q
            first = False

    def _independent(self, links: Sequence[str]) -> list[GroupLimb]:
        """The limbs of those of ``links`` that share no joint, the most constrained ones first. Raises
        KinematicsFailure."""
        def weight(link: str) -> tuple[int, int]:
            many = sum(one.link == link for one in constraints_with_links(self._constraints))
            return -many, -len(limbs_of(self._model, self._group, [link])[0].indices)

        chosen = []
        for link in sorted(links, key=weight):
            try:
                limbs_of(self._model, self._group, [*chosen, link])
            except KinematicsFailure:
                continue
            chosen.append(link)
        return limbs_of(self._model, self._group, chosen)

    def _brought(self, q: np.ndarray, manifold: Manifold) -> np.ndarray:
        """``q`` (n,), or a posture near it that satisfies the constraints on all links, if one is found."""
        own = q[self._group.indices]
        near = None if manifold.keeps(own) else manifold.project(own)
        if near is None:
            return q
        whole = np.array(q)
        whole[self._group.indices] = near
        return self._model.wrapped(whole)

    def _solutions(self, limbs: Sequence[GroupLimb], first: bool) -> list[np.ndarray]:
        """Postures [q (n,), ...] that put each link of ``limbs`` at a pose within its constraints.

        ``first``: one posture at the middle of them, near the scene's state.
        """
        state = self._scene.state
        start = state.q if first else self._outside_as_it_is(self._random())
        frames, found = self._model.frames(state.q, state.base), []
        for limb in limbs:
            target = limb.target(self._goal(limb.link, start, first), frames[self._model.link_index[limb.base]])
            near = np.clip(start[limb.indices], limb.chain.lower, limb.chain.upper)
            try:
                found.append([limb.nearest(target, near)] if first else limb.several(target, near, _SOLUTIONS))
            except NoIkSolution as error:
                self._unreachable = str(error)
                return []
        together = []
        for k in range(max(map(len, found)) if all(found) else 0):
            q = np.array(start)
            for limb, solutions in zip(limbs, found, strict=True):
                q[limb.indices] = solutions[k % len(solutions)]
            together.append(self._model.wrapped(self._outside_as_it_is(q)))
        return together

    def _goal(self, link: str, start: np.ndarray, first: bool) -> np.ndarray:
        """A pose (4, 4) of a link, or position (3,) if the orientation is free, within its constraints.

        ``first``: in the middle of them. Unconstrained parts come from the posture ``start`` (n,).
        """
        generator = self._generator
        position = next((one for one in self._constraints.positions if one.link == link), None)
        orientation = next((one for one in self._constraints.orientations if one.link == link), None)
        pose = np.array(self._model.frame_of(start, link, self._scene.state.base))
        if orientation is not None:
            turn = np.eye(3) if first else regions.turn_within(orientation.tolerances, orientation.rotation_vector,
                                                               generator)
            pose[:3, :3] = orientation.rotation @ turn @ orientation.axes.T
        if position is None:
            return pose
        shape, place = position.regions[0 if first else int(generator.integers(len(position.regions)))]
        local = regions.middle_of(shape) if first else regions.point_in(shape, generator)
        point = place[:3, :3] @ local + place[:3, 3]
        if orientation is None and not position.offset.any():
            return point
        pose[:3, 3] = point - pose[:3, :3] @ position.offset
        return pose

    def _is_wide(self) -> bool:
        """Whether the tolerances are wide, so that another pose may have a solution if one has none."""
        placed = {one.link for one in self._constraints.positions}
        turned = {one.link for one in self._constraints.orientations}
        return (placed != turned or any(len(one.regions) > 1 for one in self._constraints.positions)
                or any(max(one.tolerances) > _ONE for one in self._constraints.orientations)
                or any(regions.size_of(shape) > _ONE for one in self._constraints.positions
                       for shape, _ in one.regions))

    def _random(self) -> np.ndarray:
        return self._generator.uniform(self._low, self._high)

    def _outside_as_it_is(self, q: np.ndarray) -> np.ndarray:
        """``q`` (n,) in the group's joints, the scene's state in all others."""
        whole = np.array(self._scene.state.q)
        whole[self._group.indices] = q[self._group.indices]
        return whole


def constraints_with_links(constraints: ConstraintSet) -> tuple[PositionTarget | OrientationTarget, ...]:
    """Return the constraints of a set that are on links."""
    return constraints.positions + constraints.orientations
