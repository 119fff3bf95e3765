# SPDX-License-Identifier: BSD-3-Clause
"""Paths whose states all satisfy constraints: RRT-Connect whose steps are projected onto them
(CBiRRT; Berenson, Srinivasa, Ferguson and Kuffner 2009)."""
from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

import numpy as np

from motion_planning.constraints.manifold import Manifold
from motion_planning.planners.errors import NoPath
from motion_planning.planners.trees import Path, TreeSearch

if TYPE_CHECKING:
    from motion_planning.constraints import ConstraintSet
    from motion_planning.model import Group
    from motion_planning.planners import SearchOptions
    from motion_planning.scene import Scene
    from motion_planning.spheres import SphereChecker

# A step of a tree [rad, Euclidean]; a projected one may be longer by this factor.
_STEP, _STRETCH = 0.12, 2.0
# A step that comes less than this closer to its target ends the extension [rad].
_GAIN = 1e-3
# Straight lines between two states are halved until their points satisfy the constraints, at most this many times.
_HALVINGS = 6
_LOOKS = (0.25, 0.5, 0.75)
# Shortcuts: total tries, failed tries in a row, and the share of the remaining time for them.
_TRIES, _MISSES, _SHARE_OF_REST = 100, 30, 0.3
# A shortcut must save at least this share of the path.
_WORTH = 1e-3


class ConstrainedPlanning:
    """One search. checker: SphereChecker; if spheres touch, exact geometry decides."""

    _manifold: Manifold

    def __init__(self, scene: Scene, group: Group, checker: SphereChecker, search: SearchOptions,
                 constraints: ConstraintSet) -> None:
        self._scene, self._group, self._checker, self._search = scene, group, checker, search
        self._constraints = constraints
        self._random = np.random.default_rng(search.seed & (1 << 63) - 1)
        self._run = TreeSearch(search.seed, search.clock() + search.allowed_time, search.clock, search.stop)
        # Set after exact geometry has refused a path that is free by spheres.
        self._doubts_spheres = False

    def path(self, start: np.ndarray, goals: np.ndarray) -> Path:
        """Return a Path from ``start`` (k,) to one of ``goals`` (g, k), which satisfy the constraints and are free. Its
        points are so dense that the lines between them satisfy the constraints, too. Raises NoPath.
        """
        self._manifold = Manifold(self._scene, self._group, self._constraints, start)
        kept = [goal for goal in goals if self._manifold.keeps(goal)]
        if not self._manifold.keeps(start) or not kept:
            raise NoPath("%s does not keep to the path constraints"
                         % ("the start" if kept else "the goal" if len(goals) == 1 else "no goal"))
        kept.sort(key=lambda goal: np.linalg.norm(goal - start))
        while True:
            points = self._shortened(self._connected(start, np.array(kept)))
            blocked = self._first_blocked(points)
            if blocked is None:
                return Path(points)
            self._run.check("a path was looked for that exact geometry agrees with")
            self._doubts_spheres = True

    # -- trees --------------------------------------------------------------------------------------------------

    def _connected(self, start: np.ndarray, goals: np.ndarray) -> np.ndarray:
        """Points (m, k) from start to one of the goals."""
        trees = (_Tree(start[None]), _Tree(goals))
        for number in range(len(goals)):
            end = self._grow(trees[0], 0, goals[number])
            if np.array_equal(trees[0].points[end], goals[number]):
                return trees[0].way(end)
        low, high = self._manifold.bounds.T
        for turn in itertools.count():
            grown, other = (trees[0], trees[1]) if turn % 2 == 0 else (trees[1], trees[0])
            sample = self._random.uniform(low, high)
            new = self._grow(grown, grown.nearest(sample), sample)
            target = grown.points[new]
            end = self._grow(other, other.nearest(target), target)
            if np.array_equal(other.points[end], target):
                ways = (grown.way(new), other.way(end))
                first, second = ways if turn % 2 == 0 else ways[::-1]
                return np.concatenate([first, second[-2::-1]])
            self._run.check("a path that keeps to the constraints was looked for: the trees from start and goal have "
                            "%d and %d postures" % (trees[0].size, trees[1].size))
        raise AssertionError("not reached")

    def _grow(self, tree: _Tree, node: int, target: np.ndarray) -> int:
        """Add nodes from ``node`` towards ``target`` (k,) as far as possible; return the last one."""
        for step in self._steps(tree.points[node], target):
            for q in step:
                node = tree.add(q, node)
        return node

    def _steps(self, q: np.ndarray, target: np.ndarray) -> Iterator[list[np.ndarray]]:
        """Towards a target, step by step: each a list of points (k,) whose lines satisfy the constraints and are free;
        the last point is the target itself if it is reached."""
        while True:
            self._run.check("a path that keeps to the constraints was looked for")
            rest = target - q
            left = float(np.linalg.norm(rest))
            if left == 0.0:
                return
            new = target if left <= _STEP else self._kept(q + rest * (_STEP / left))
            if new is None or np.linalg.norm(target - new) > left - min(_GAIN, 0.5 * left) \
                    or np.linalg.norm(new - q) > _STRETCH * _STEP:
                return
            points = self._line(q, new, _HALVINGS)
            if points is None or not self._is_free(q, points):
                return
            yield points
            q = new

    def _line(self, a: np.ndarray, b: np.ndarray, halvings: int) -> list[np.ndarray] | None:
        """Points after ``a`` up to ``b`` whose lines satisfy the constraints; None if there are none."""
        if all(self._manifold.keeps(a + share * (b - a)) for share in _LOOKS):
            return [b]
        middle = self._kept(0.5 * (a + b)) if halvings else None
        if middle is None or max(np.linalg.norm(middle - a), np.linalg.norm(b - middle)) > np.linalg.norm(b - a):
            return None
        first = self._line(a, middle, halvings - 1)
        second = None if first is None else self._line(middle, b, halvings - 1)
        return None if first is None or second is None else first + second

    def _kept(self, q: np.ndarray) -> np.ndarray | None:
        """``q`` (k,) itself if it satisfies the constraints, else a posture near it that does, None if none is
        found."""
        return q if self._manifold.keeps(q) else self._manifold.project(q)

    def _shortened(self, points: np.ndarray) -> np.ndarray:
        run = self._run
        end = run.clock() + _SHARE_OF_REST * max(0.0, run.deadline - run.clock())
        missed = 0
        for _ in range(_TRIES):
            if len(points) < 3 or missed >= _MISSES or run.clock() >= end:
                break
            i, k = sorted(self._random.choice(len(points), 2, replace=False))
            direct = float(np.linalg.norm(points[k] - points[i]))
            if k - i < 2 or direct > (1.0 - _WORTH) * _length(points[i:k + 1]):
                missed += 1
                continue
            way = [points[i], *itertools.chain.from_iterable(self._steps(points[i], points[k]))]
            if np.array_equal(way[-1], points[k]) and \
                    _length(points[i:k + 1]) - _length(np.array(way)) > _WORTH * _length(points):
                points = np.concatenate([points[:i], way, points[k + 1:]])
                missed = 0
            else:
                missed += 1
        return points

    # -- collisions ---------------------------------------------------------------------------------------------

    def _is_free(self, a: np.ndarray, points: Iterable[np.ndarray]) -> bool:
        for b in points:
            if (self._doubts_spheres or not self._checker.edge(a, b)) and \
                    self._first_blocked(np.array([a, b])) is not None:
                return False
            a = b
        return True

    def _first_blocked(self, points: np.ndarray) -> np.ndarray | None:
        """The first state along ``points``, except the first point, that is in collision; None if all are free."""
        states = []
        for a, b in itertools.pairwise(points):
            count = max(1, math.ceil(np.linalg.norm(b - a) / (0.5 * self._checker.resolution)))
            states.append(a + (b - a) * (np.arange(1, count + 1)[:, None] / count))
        for some in states:
            self._run.check("a path was checked by exact geometry")
            first = self._search.exact.first_blocked(self._scene, some, self._group.name)
            if first is not None:
                return some[first]
        return None


class _Tree:
    """Postures and the parent of each."""

    def __init__(self, roots: np.ndarray) -> None:
        self._room = np.array(roots, dtype=float)
        self._parents, self.size = [-1] * len(roots), len(roots)

    @property
    def points(self) -> np.ndarray:
        """(size, k)"""
        return self._room[:self.size]

    def add(self, q: np.ndarray, parent: int) -> int:
        if self.size == len(self._room):
            self._room = np.concatenate([self._room, np.empty((max(64, self.size), self._room.shape[1]))])
        self._room[self.size] = q
        self._parents.append(parent)
        self.size += 1
        return self.size - 1

    def nearest(self, q: np.ndarray) -> int:
        return int(np.square(self.points - q).sum(axis=1).argmin())

    def way(self, node: int) -> np.ndarray:
        """Points (m, k) from a root to the node."""
        way = []
        while node >= 0:
            way.append(self._room[node])
            node = self._parents[node]
        return np.array(way[::-1])


def _length(points: np.ndarray) -> float:
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
