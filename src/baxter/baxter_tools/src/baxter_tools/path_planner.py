# SPDX-License-Identifier: BSD-3-Clause
"""A collision-free path between two postures. Free of ROS.

Two trees of postures grow from both ends towards random ones and towards each other until they meet (RRT-connect:
Kuffner and LaValle, ICRA 2000); then corners are cut off. Straight paths, also through given postures, are tried first:
nearly always one of them is free.
"""
from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.random import Generator
    from numpy.typing import ArrayLike

    from baxter_tools.self_clearance import SelfClearance

# Distance between checked postures of a path, by the joint that moves most [rad].
RESOLUTION_RAD = 0.02
# Longest extension of a tree, by the same measure [rad].
STRETCH_RAD = 0.4
# Of 100 random postures the hardest took some 4,000; without any way it says so after half a minute or less.
TREE_LIMIT = 12000
SHORT_CUTS = 60
# Search for a free posture around a start in contact: distance [rad] and number of tries.
ESCAPE_RADII_RAD = (0.05, 0.1, 0.2, 0.4, 0.8)
ESCAPE_TRIES = 60
# A path out of a contact may be closer than the contact by this much [m].
ESCAPE_SLACK_M = 0.001


class NoFreePath(Exception):
    """No free path was found; the text gives the reason."""


class PathPlanner:
    """Plans paths of postures (n,) [rad].

    Parameters:
        lower, upper: limits of the joints (n,).
        clearance: function of a posture that returns the least distance between parts [m], negative where they overlap.
        margin_m: least clearance of a path; if an end has less, that of the end. rng: numpy random generator; the same
        one gives the same paths.
    """

    def __init__(self, lower: ArrayLike, upper: ArrayLike, clearance: Callable[[Any], Any] | SelfClearance,
                 margin_m: float, rng: Generator) -> None:
        self._lower, self._upper = np.asarray(lower, dtype=float), np.asarray(upper, dtype=float)
        self._clearance = clearance
        self._margin_m = margin_m
        self._rng = rng

    def plan(self, start: ArrayLike, goal: ArrayLike, via: Sequence[np.ndarray] = ()) -> list[np.ndarray]:
        """Return a path from `start` to `goal` as a list of postures, straight in between; `via`: postures to try
        first.

        A start in contact is left by a path that increases the clearance. Raises NoFreePath.
        """
        first, last = np.asarray(start, dtype=float), np.asarray(goal, dtype=float)
        at_goal_m = self._clearance(last)
        if at_goal_m <= 0.0:
            raise NoFreePath("parts of the robot overlap by %.0f mm where it should go" % (-1000.0 * at_goal_m))
        # The folded arm is closer to its own body than the margin of a path.
        margin_m = min(self._margin_m, 0.9 * at_goal_m)
        way = [first]
        if self._clearance(first) < margin_m:
            way.append(self._escape(first, margin_m))
        for stops in itertools.chain([()], ([stop] for stop in via), [via] if len(via) > 1 else []):
            legs = [way[-1], *stops, last]
            if all(self._is_free(a, b, margin_m) for a, b in itertools.pairwise(legs)):
                return self._shorten([*way, *legs[1:]], margin_m)
        return self._shorten([*way, *self._connect(way[-1], last, margin_m)[1:]], margin_m)

    def _is_free(self, a: Any, b: Any, margin_m: float) -> bool:
        count = max(1, int(np.ceil(np.abs(b - a).max() / RESOLUTION_RAD)))
        # Coarse steps first: obstacles are thick, and are found sooner this way.
        steps = sorted(range(1, count + 1), key=_bits_reversed)
        return all(self._clearance(a + (b - a) * (step / count)) >= margin_m for step in steps)

    def _escape(self, start: np.ndarray, margin_m: float) -> np.ndarray:
        touch_m = self._clearance(start)
        for radius in ESCAPE_RADII_RAD:
            for _ in range(ESCAPE_TRIES):
                end = np.clip(start + self._rng.uniform(-radius, radius, len(start)), self._lower, self._upper)
                if self._clearance(end) >= margin_m and self._is_free(start, end, touch_m - ESCAPE_SLACK_M):
                    return end
        raise NoFreePath("parts of the robot touch (clearance %.0f mm) and no way out was found" % (1000.0 * touch_m))

    def _connect(self, start: np.ndarray, goal: np.ndarray, margin_m: float) -> list[np.ndarray]:
        trees = [_Tree(start), _Tree(goal)]
        for turn in range(TREE_LIMIT):
            grown, other = trees[turn % 2], trees[1 - turn % 2]
            node = self._grow(grown, self._rng.uniform(self._lower, self._upper), margin_m)
            if node is None:
                continue
            target, meeting = grown.postures[node], None
            while (meeting := self._grow(other, target, margin_m)) is not None:
                if np.array_equal(other.postures[meeting], target):
                    here, there = grown.branch(node), other.branch(meeting)
                    return here[::-1] + there[1:] if grown is trees[0] else there[::-1] + here[1:]
        raise NoFreePath("no free way was found in %d tries" % TREE_LIMIT)

    def _grow(self, tree: _Tree, target: np.ndarray, margin_m: float) -> int | None:
        """Extend `tree` towards `target`; return the new node, or None if it is blocked."""
        nearest = tree.nearest(target)
        from_here = tree.postures[nearest]
        distance = np.abs(target - from_here).max()
        end = target if distance <= STRETCH_RAD else from_here + (target - from_here) * (STRETCH_RAD / distance)
        return tree.add(end, nearest) if self._is_free(from_here, end, margin_m) else None

    def _shorten(self, way: list[np.ndarray], margin_m: float) -> list[np.ndarray]:
        """Remove postures where the straight path is free. The first segment out of a contact stays."""
        first = 1 if len(way) > 1 and self._clearance(way[0]) < margin_m else 0
        for _ in range(SHORT_CUTS):
            if len(way) - first < 3:
                break
            a = int(self._rng.integers(first, len(way) - 2))
            b = int(self._rng.integers(a + 2, len(way)))
            if self._is_free(way[a], way[b], margin_m):
                way = way[:a + 1] + way[b:]
        return way


class _Tree:
    def __init__(self, root: np.ndarray) -> None:
        self.postures = [root]
        self._parents: list[int | None] = [None]

    def nearest(self, target: np.ndarray) -> int:
        return int(np.abs(np.array(self.postures) - target).max(axis=1).argmin())

    def add(self, posture: np.ndarray, parent: int) -> int:
        self.postures.append(posture)
        self._parents.append(parent)
        return len(self.postures) - 1

    def branch(self, node: int) -> list[np.ndarray]:
        """Postures from `node` back to the root."""
        way, here = [], node
        while here is not None:
            way.append(self.postures[here])
            here = self._parents[here]
        return way


def _bits_reversed(number: int) -> int:
    return int(format(number, "016b")[::-1], 2)
