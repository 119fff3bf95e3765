# SPDX-License-Identifier: BSD-3-Clause
"""RRT-Connect (Kuffner and LaValle 2000) and shortcuts, on a SphereChecker."""
from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from motion_planning.planners import kernels
from motion_planning.planners.errors import NoPath

if TYPE_CHECKING:
    from motion_planning.spheres import SphereChecker

    Trees = tuple[np.ndarray, np.ndarray, np.ndarray]
    Planner = Callable[[SphereChecker, np.ndarray, np.ndarray, np.ndarray, "TreeSearch"], "Path"]

#: The longest edge of a tree [rad, Euclidean distance of joint values]. Longer ones find fewer narrow passages.
REACH = 0.5
#: Number of samples between two checks of the clock: about 2 ms.
SAMPLES = 1000
_MIN_ROOM, _MAX_ROOM = 4096, 1 << 20
_ALL = (1 << 64) - 1
# Shortcuts: total tries, failed tries in a row.
_TRIES, _MISSES = 200, 30
#: Number of tries to make a path shorter that is good enough already, and the share of those that change one joint.
IMPROVING, _SINGLE = 2000, 0.5
# Tries before the first look at the clock, and the time [s] between two looks that later ones aim at: among the cubes
# of an octomap a try may take a hundred times as long as among boxes.
_FIRST_TRIES, _LOOK_S = 4, 2e-3


class Path(NamedTuple):
    """points (m, k): corners of a path of straight lines, the first is the start. samples: number of drawn ones. times:
    {part of the work: s}, if measured. remarks: sentences on what was coarser than usual."""

    points: np.ndarray
    samples: int = 0
    times: Mapping[str, float] = MappingProxyType({})
    remarks: tuple[str, ...] = ()

    @property
    def length(self) -> float:
        """The sum of Euclidean distances [rad]."""
        return float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).sum())


class TreeSearch(NamedTuple):
    """seed: the same one gives the same path. deadline: on ``clock``, a function that returns seconds. stop: a function
    called every few ms; true ends the search. samples: the number of them after which a search gives up."""

    seed: int
    deadline: float
    clock: Callable[[], float]
    stop: Callable[[], bool] = lambda: False
    samples: float = math.inf

    def check(self, what: str) -> None:
        """Raise NoPath if the deadline has passed or the caller stops the search."""
        if self.stop():
            raise NoPath("stopped while %s" % what, stopped=True)
        if self.clock() >= self.deadline:
            raise NoPath("time was over while %s" % what, late=True)


def rrt_connect(checker: SphereChecker, bounds: np.ndarray, start: np.ndarray, goals: np.ndarray, run: TreeSearch,
                reach: float = REACH) -> Path:
    """Return a Path from ``start`` (k,) to one of ``goals`` (g, k), free by ``checker`` (SphereChecker).

    Two trees grow towards each other, the smaller one first. bounds (k, 2): of the samples; start and goals must be
    free. Raises NoPath if the deadline has passed or ``run.stop`` is true.
    """
    return next(path for path in growing(checker, bounds, start, goals, run, reach) if path is not None)


def growing(checker: SphereChecker, bounds: np.ndarray, start: np.ndarray, goals: np.ndarray, run: TreeSearch,
            reach: float = REACH) -> Iterator[Path | None]:
    """``rrt_connect`` in parts of ``SAMPLES`` samples: yields None after each one, and at last the Path."""
    start, goals = np.asarray(start, dtype=np.float32), np.atleast_2d(np.asarray(goals, dtype=np.float32))
    for goal in goals[np.argsort(np.linalg.norm(goals - start, axis=1), kind="stable")]:
        if checker.edge(start, goal):
            yield Path(np.array([start, goal], dtype=float))
            return
    bounds = np.ascontiguousarray(np.asarray(bounds).T, dtype=np.float32)
    trees = _seeds(start, goals, run.seed)
    while True:
        result = kernels.grow(checker.tables, trees, (bounds[0], bounds[1]), np.float32(reach),
                              np.float32(checker.resolution), SAMPLES)
        if result == kernels.MET:
            yield Path(kernels.traced(*trees), int(trees[2][6]))
            return
        run.check("a path was looked for: %d samples were drawn, the trees from start and goal have %d and %d postures"
                  % (trees[2][6], trees[2][0], trees[2][1]))
        if trees[2][6] >= run.samples:
            raise NoPath("no path was found with %d samples" % trees[2][6], spent=True)
        if result == kernels.FULL:
            trees = _roomier(trees)
        yield None


def shorten(path: Path, checker: SphereChecker, run: TreeSearch, tries: int = _TRIES, misses: int = _MISSES) -> Path:
    """Return the Path without detours for which ``checker`` finds a straight line; it is never longer than before. Ends
    after so many ``tries``, or so many ``misses`` in a row."""
    return _shorter(path, checker, _numbers(run.seed), (tries, misses, 0.0))


def improve(path: Path, checker: SphereChecker, run: TreeSearch) -> Path:
    """Return the Path after ``IMPROVING`` tries to make it shorter, some 20 ms for both arms of Baxter, or fewer if the
    deadline has passed. Raises NoPath if it is stopped."""
    numbers, tries, left = _numbers(run.seed), _FIRST_TRIES, IMPROVING
    now = run.clock()
    while left and now < run.deadline:
        if run.stop():
            raise NoPath("stopped while a path was made shorter", stopped=True)
        path = _shorter(path, checker, numbers, (tries, tries, _SINGLE))
        before, now = now, run.clock()
        left -= tries
        # How many tries are made at once has no influence on the path.
        wanted = tries * _LOOK_S / max(now - before, 0.5 * _LOOK_S)
        tries = min(left, max(1, int(wanted)))
    return path


def _shorter(path: Path, checker: SphereChecker, numbers: np.ndarray, effort: tuple[int, int, float]) -> Path:
    """effort: as of ``kernels.shortcut``."""
    count = len(path.points)
    points = np.empty((count + 2 * effort[0] + 2, path.points.shape[1]), np.float32)
    points[:count] = path.points
    count = kernels.shortcut(checker.tables, points, count, numbers, np.float32(checker.resolution), effort)
    return path._replace(points=points[:count].astype(float))


def _numbers(seed: int) -> np.ndarray:
    numbers = np.zeros(7, np.int64)
    # Similar seeds must not give similar sequences, and 0 would give only zeros: splitmix64 (Steele, Lea, Flood 2014).
    bits = (seed + 1) * 0x9E3779B97F4A7C15 & _ALL
    bits = (bits ^ bits >> 30) * 0xBF58476D1CE4E5B9 & _ALL
    bits = (bits ^ bits >> 27) * 0x94D049BB133111EB & _ALL
    numbers[3] = (bits ^ bits >> 31) >> 1 | 1
    return numbers


def _seeds(start: np.ndarray, goals: np.ndarray, seed: int) -> Trees:
    """Trees that consist of their roots."""
    room = max(_MIN_ROOM, 2 * len(goals) + 16)
    room += -room % 16
    nodes, parents = np.empty((2, len(start), room), np.float32), np.empty((2, room), np.int32)
    numbers = _numbers(seed)
    nodes[0, :, 0], nodes[1, :, : len(goals)] = start, goals.T
    parents[0, 0] = parents[1, : len(goals)] = -1
    numbers[:2] = 1, len(goals)
    return nodes, parents, numbers


def _roomier(trees: Trees) -> Trees:
    nodes, parents, numbers = trees
    room = 4 * nodes.shape[2]
    if room > _MAX_ROOM:
        raise NoPath("a path was looked for until memory was full: %d samples were drawn" % numbers[6])
    more = np.empty((2, nodes.shape[1], room), np.float32)
    more[:, :, : nodes.shape[2]] = nodes
    more_parents = np.full((2, room), -1, np.int32)
    more_parents[:, : parents.shape[1]] = parents
    return more, more_parents, numbers
