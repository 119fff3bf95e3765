# SPDX-License-Identifier: BSD-3-Clause
"""Plans two arms of one group one by one, and combines their paths.

Two arms collide with each other in few of their postures. One arm has half the joints, so its path is found much
faster. A path of both needs a path of each alone: if one arm has none, the search in the space of all joints is not
needed. If the arms cannot pass each other on several pairs of paths, that search and further pairs take turns: either
alone may take a hundred times as long as usual, both hardly ever do. Further pairs have one arm move aside first: the
short paths of one arm are all alike.
"""
from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np

from motion_planning.planners import kernels
from motion_planning.planners.trees import SAMPLES, Path, growing, shorten

if TYPE_CHECKING:
    from collections.abc import Sequence

    from motion_planning.planners.trees import TreeSearch
    from motion_planning.spheres import SphereChecker

    Parts = Sequence[tuple[np.ndarray, SphereChecker]]

# Distance [rad] of postures on the path of one arm that are combined with those of the other.
_SPACING = 0.3
# Number of searches for a path through these postures that avoids steps found to be in collision.
_TURNS = 4
# Tries and misses of shortcuts, see ``shorten``: of the path of one arm, and afterwards of the path of both.
_ALONE, TOGETHER = (80, 10), (50, 8)
# Number of pairs of paths to try before both arms are searched together, too: another pair may leave more room.
_PAIRS = 3
# Least number of samples for both arms together in a turn, about as much work as one pair of paths; and the most for
# the way to or from a random posture.
_IN_A_TURN = 2 * SAMPLES


def two_parts(checker: SphereChecker, bounds: np.ndarray, start: np.ndarray, goals: np.ndarray, run: TreeSearch,
              reach: float) -> Path:
    """Return a Path from ``start`` (k,) to one of ``goals`` (g, k) for a ``checker`` of two parts, which are planned
    one by one where they get past each other so; its times are then of "shorten". Arguments and errors as in
    ``rrt_connect``."""
    nearest = goals[np.linalg.norm(goals - start, axis=1).argmin()]
    together, samples, shortening = growing(checker, bounds, start, goals, run, reach), 0, 0.0
    for turn in itertools.count():
        again, seconds = run._replace(seed=run.seed + turn), 0.0
        if turn < _PAIRS:
            points, drawn, seconds = _one_by_one(checker, bounds, start, nearest, again, reach)
        else:
            points, drawn = _in_turns(checker, bounds, start, nearest, again, reach, turn % 2)
        samples, shortening = samples + drawn, shortening + seconds
        if points is not None:
            return Path(points, samples, {"shorten": shortening})
        if turn + 1 < _PAIRS:
            continue
        for found in itertools.islice(together, max(drawn, _IN_A_TURN) // SAMPLES):
            if found is not None:
                return found._replace(samples=samples + found.samples)
    raise AssertionError("not reached")


def _one_by_one(checker: SphereChecker, bounds: np.ndarray, start: np.ndarray, goal: np.ndarray, run: TreeSearch,
                reach: float) -> tuple[np.ndarray | None, int, float]:
    """(points (m, k), samples, seconds for shortcuts) of one path of each part, brought together; points are None where
    the parts cannot pass each other on these."""
    samples, shortening, ways = 0, 0.0, []
    for indices, alone in checker.parts:
        found = next(path for path in growing(alone, bounds[indices], start[indices], goal[indices], run, reach)
                     if path is not None)
        samples += found.samples
        since = run.clock()
        ways.append(shorten(found, alone, run, *_ALONE).points)
        shortening += run.clock() - since
    points = _synchronized(checker.parts, ways)
    if not checker.between_parts.way(points):
        points = _coordinated(checker, ways)
    return points, samples, shortening


def _in_turns(checker: SphereChecker, bounds: np.ndarray, start: np.ndarray, goal: np.ndarray, run: TreeSearch,
              reach: float, yielding: int) -> tuple[np.ndarray | None, int]:
    """(points (m, k), samples): a part moves to a random posture, then the other part to its goal, then the first part.
    The searches are bounded, since the posture may be out of reach; points are None where one of them ends."""
    indices, alone = checker.parts[yielding]
    aside, arrived = start.copy(), goal.copy()
    aside[indices] = arrived[indices] = _free_posture_of(alone, bounds[indices], run)
    samples, ways = 0, [start[None]]
    for moving, (begin, end) in zip((indices, np.setdiff1d(np.arange(len(start)), indices), indices),
                                    itertools.pairwise([start, aside, arrived, goal]), strict=True):
        within = np.column_stack([begin, begin])
        within[moving] = bounds[moving]
        searched = itertools.islice(growing(checker, within, begin, end, run, reach), _IN_A_TURN // SAMPLES)
        found = next((path for path in searched if path is not None), None)
        samples += _IN_A_TURN if found is None else found.samples
        if found is None:
            return None, samples
        ways.append(found.points[1:])
    return np.concatenate(ways), samples


def _free_posture_of(alone: SphereChecker, bounds: np.ndarray, run: TreeSearch) -> np.ndarray:
    """A random posture (j,) that is free for one part."""
    random, (low, high) = np.random.default_rng(run.seed), bounds.T
    while True:
        some = random.uniform(low, high, (16, len(bounds)))
        free = np.flatnonzero(alone.valid(some))
        if len(free):
            return some[free[0]]
        run.check("a posture was looked for where one arm is out of the other's way")


def _synchronized(parts: Parts, ways: Sequence[np.ndarray]) -> np.ndarray:
    """The points (m, k) of both parts beginning and ending at the same time."""
    (one, _), (other, _) = parts
    found = kernels.at_once(*ways)
    points = np.empty_like(found)
    points[:, one], points[:, other] = found[:, : len(one)], found[:, len(one) :]
    return points


def _coordinated(checker: SphereChecker, ways: Sequence[np.ndarray]) -> np.ndarray | None:
    """The points (m, k) of the two parts moving along their paths; one waits or moves back for the other if needed.
    None if that does not help."""
    grid = _grid(checker.parts, *map(_dense, ways))
    free = checker.between_parts.valid(grid.reshape(-1, grid.shape[2])).reshape(grid.shape[:2])
    # The caller has checked that both ends are free.
    free[0, 0] = free[-1, -1] = True
    closed = np.zeros((*free.shape, 9), dtype=np.bool_)
    known = set()
    for _ in range(_TURNS):
        cells = kernels.way_through(free, closed)
        points = grid[cells[:, 0], cells[:, 1]]
        if not len(cells):
            return None
        # Ways that avoid a step have most others in common.
        steps = list(itertools.pairwise(map(tuple, cells.tolist())))
        open_ones = checker.between_parts.edges(points, np.array([step in known for step in steps]))
        bad = np.flatnonzero(~open_ones)
        if not len(bad):
            return points
        known.update(itertools.compress(steps, open_ones))
        for k in bad:
            (i, j), (di, dj) = cells[k], cells[k + 1] - cells[k]
            closed[i, j, 3 * di + dj + 4] = closed[i + di, j + dj, 4 - 3 * di - dj] = True
    return None


def _grid(parts: Parts, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """(a, b, k): each posture ``first`` (a, i) of one part with each ``second`` (b, j) of the other."""
    (one, _), (other, _) = parts
    grid = np.empty((len(first), len(second), len(one) + len(other)), dtype=np.float32)
    grid[:, :, one], grid[:, :, other] = first[:, None], second
    return grid


def _dense(way: np.ndarray) -> np.ndarray:
    """The path (m, j) with points added between its corners."""
    steps = np.diff(way, axis=0)
    counts = np.maximum(1, np.ceil(np.linalg.norm(steps, axis=1) / _SPACING)).astype(int)
    line = np.repeat(np.arange(len(steps)), counts)
    number = np.arange(len(line)) - np.repeat(np.cumsum(counts) - counts, counts)
    return np.concatenate([way[line] + steps[line] * (number / counts[line])[:, None], way[-1:]])
