# SPDX-License-Identifier: BSD-3-Clause
"""A :class:`CollisionChecker` on the shapes of a bullet_sim world. Imported only where it is used: importing PyBullet
is slow.
"""
from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from arm_kinematics.collision import Touch
from bullet_sim import LOG, World
from urdf_model import Mesh

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from bullet_sim import ContactPoint, Model
    from urdf_model import Robot
    from urdf_model.merge import MergedLink

# Random postures in which the hull of a fixed link's mesh must touch what the mesh touches, to replace it.
_COMPARED = 300


class BulletChecker:
    """Checks in a separate world, or in a given one, whether a robot touches itself or another model.

    One thread at a time. Only contacts that the given joints can change count: the other arm's contact with a table
    does not.
    """

    def __init__(self, world: World, model: Model, self_collision_pairs: Iterable[tuple[str, str]] | None = None,
                 margin_m: float = 0.0, rough: tuple[World, Model] | None = None) -> None:
        """``model``: the robot in ``world`` (bullet_sim); ``self_collision_pairs``: [(link, link)] that must not
        touch, all plausible ones if None. ``margin_m``: allowed depth of a contact; shapes are often a little
        too large. ``rough``: (World, Model) of the same robot, in which the meshes of its fixed link are convex.
        """
        self._world, self._model, self._margin_m = world, model, margin_m
        pairs = plausible_pairs(world, model) if self_collision_pairs is None else self_collision_pairs
        model.set_self_collision_pairs(pairs)
        self._rough, self._is_convex = rough, False
        if rough is not None:
            rough[1].set_self_collision_pairs(pairs)
            self._is_convex = self._agree(rough)
        self._plans: dict[tuple[str, ...], tuple[np.ndarray, set[str], set[str]]] = {}

    @classmethod
    def of_robot(cls, robot: Robot, self_collision_pairs: Iterable[tuple[str, str]] | None = None,
                 margin_m: float = 0.0, find_mesh: Callable[[str], str | None] | None = None,
                 mesh_cuts: Mapping[str, ArrayLike] | None = None,
                 warn: Callable[[str], None] = LOG.warning) -> BulletChecker:
        """Return a checker with a separate world, in which ``robot`` (urdf_model.Robot) stands fixed at the origin.

        ``find_mesh``, ``warn``: as for ``bullet_sim.World``; ``mesh_cuts``: as for its ``spawn``.
        """
        options: dict[str, Any] = {} if find_mesh is None else {"find_mesh": find_mesh}
        cuts: dict[str, Any] = {} if mesh_cuts is None else {"mesh_cuts": mesh_cuts}
        world = World(warn=warn, **options)
        model = world.spawn(robot, robot.name or "robot", static=True, **cuts)
        rough = None
        if mesh_cuts is None and _has_meshes(model.merged.links[model.merged.root]):
            # The first world has said what it lacks.
            rough_world = World(warn=lambda text: None, **options)
            # Meshes of a body that moves are convex; without a step it stays.
            rough = rough_world, rough_world.spawn(robot, robot.name or "robot", static=False)
        return cls(world, model, self_collision_pairs, margin_m, rough)

    @property
    def world(self) -> World:
        """The bullet_sim.World; spawn obstacles into it."""
        return self._world

    def known(self, joint_names: Sequence[str], q: Iterable[float]) -> tuple[list[str], list[float]]:
        """Return (names, values) of the joints that the robot has and whose value is finite."""
        has = set(self._model.joint_names)
        pairs = [pair for pair in zip(joint_names, q, strict=False) if pair[0] in has and np.isfinite(pair[1])]
        return [name for name, _ in pairs], [value for _, value in pairs]

    def set_posture(self, joint_names: Sequence[str], q: ArrayLike) -> None:
        """Set the other joints of the robot, such as the other arm's."""
        self._put(self._model.index(joint_names), np.asarray(q, dtype=float))

    def contact(self, joint_names: Sequence[str], q: np.ndarray) -> Touch | None:
        """Return the deepest Touch of the robot with its ``joint_names`` at ``q``, or None if there is none."""
        return self.contact_and_cause(joint_names, q)[0]

    def contact_and_cause(self, joint_names: Sequence[str], q: np.ndarray) -> tuple[Touch | None, bool]:
        """Return (:meth:`contact`, whether the pose of the last joint's link alone is the cause).

        It is where that link, or one beyond it, touches a body that none of ``joint_names`` (base to tip) moves: then
        every posture touches that has this link in the same pose.
        """
        index, moved, last = self._plan(tuple(joint_names))
        self._put(index, q)
        worst, is_fixed = None, False
        for found in self._touching():
            if found.distance >= -self._margin_m:
                continue
            ours, others = self._named(found)
            ours_moved = [link for link in ours if link in moved]
            if not ours_moved:
                continue
            is_fixed = is_fixed or (len(ours_moved) == 1 and ours_moved[0] in last)
            if worst is None or found.distance < -worst.depth_m:
                worst = Touch(ours[0], others, len(ours) == 1, -found.distance)
        return worst, is_fixed

    def _put(self, index: np.ndarray, q: np.ndarray) -> None:
        self._model.set_joint_positions(index, q)
        if self._rough is not None:
            self._rough[1].set_joint_positions(index, q)

    def _touching(self) -> list[ContactPoint]:
        """The contacts of the robot. Those with a fixed link of triangles take twenty times as long as all others, and
        are looked at where something touches its convex hull, unless that is as good."""
        if self._rough is not None and len(self._world.models) == 1:
            world, model = self._rough
            found, fixed = world.touching(model), model.merged.root
            if self._is_convex or all(fixed not in (one.link_a, one.link_b) for one in found):
                return found
        return self._world.touching(self._model)

    def _agree(self, rough: tuple[World, Model]) -> bool:
        """Whether the same pairs touch with the fixed link as its hull, in all of some random postures."""
        (world, model), index = rough, np.arange(len(self._model.joint_names))
        for q in random_postures(model, _COMPARED):
            self._put(index, q)
            if _touching_pairs(world, model) != _touching_pairs(self._world, self._model):
                return False
        return True

    def close(self) -> None:
        """Close the world."""
        self._world.close()
        if self._rough is not None:
            self._rough[0].close()

    def _plan(self, joint_names: tuple[str, ...]) -> tuple[np.ndarray, set[str], set[str]]:
        """Return (index of the joints, names of the links that they move, of those that the last one moves); computed
        once."""
        if joint_names not in self._plans:
            moved, last = set(), set()
            for joint in self._model.merged.joints.values():  # parents come before their children
                if joint.name in joint_names or joint.parent in moved:
                    moved.add(joint.child)
                if joint.name == joint_names[-1] or joint.parent in last:
                    last.add(joint.child)
            self._plans[joint_names] = (self._model.index(joint_names), moved, last)
        return self._plans[joint_names]

    def _named(self, found: ContactPoint) -> tuple[tuple[str, ...], str]:
        """Return (our links that take part, the other one's name)."""
        if found.model_a == found.model_b:
            return (found.link_a, found.link_b), found.link_b
        if found.model_a == self._model.name:
            return (found.link_a,), "%s/%s" % (found.model_b, found.link_b)
        return (found.link_b,), "%s/%s" % (found.model_a, found.link_a)


def random_postures(model: Model, count: int) -> np.ndarray:
    """Postures (count, n) within the joints' limits, of joints that turn on and on within a turn; always the same."""
    low, high = np.clip(model.lower, -np.pi, np.pi), np.clip(model.upper, -np.pi, np.pi)
    return np.random.default_rng(0).uniform(low, high, (count, len(low)))


def _touching_pairs(world: World, model: Model) -> set[frozenset[str]]:
    return {frozenset((found.link_a, found.link_b)) for found in world.touching(model)
            if found.model_a == found.model_b and found.distance < 0.0}


def _has_meshes(link: MergedLink) -> bool:
    return any(isinstance(one.geometry, Mesh) for one in link.collisions)


def plausible_pairs(world: World, model: Model, samples: int = 50) -> list[tuple[str, str]]:
    """Return [(link, link)] of ``model`` that have no joint between them and do not always overlap.

    A pair counts as always overlapping if it touches in more than half of ``samples`` random postures.
    """
    neighbours = {frozenset((joint.parent, joint.child)) for joint in model.merged.joints.values()}
    pairs = [pair for pair in itertools.combinations(model.merged.links, 2) if frozenset(pair) not in neighbours]
    model.set_self_collision_pairs(pairs)
    touches = Counter()
    for q in random_postures(model, samples):
        model.set_joint_positions(np.arange(len(q)), q)
        touches.update(_touching_pairs(world, model))
    return [pair for pair in pairs if touches[frozenset(pair)] <= samples // 2]
