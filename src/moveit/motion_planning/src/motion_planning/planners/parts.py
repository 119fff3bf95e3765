# SPDX-License-Identifier: BSD-3-Clause
"""Two arms of one group planned for one by one, and their paths brought together.

Two arms get into each other's way at few of their postures. An arm alone has half the joints, and a path of both needs
a path of each alone: what is found so is found much sooner, and what is not there need not be looked for in the space
of all joints.
"""
import itertools

import numpy as np

from motion_planning.planners import kernels
from motion_planning.planners.trees import Path, rrt_connect, shorten

# How far apart [rad] postures on the path of one arm are that are looked at together with those of the other.
_SPACING = 0.15
# So often a way through these postures is looked for that avoids steps that turned out to touch something.
_TURNS = 4
# So many pairs of paths are tried: others may leave room for each other.
_PAIRS = 3


def apart(checker, bounds, start, goal, run, reach):
    """Return a Path from ``start`` (k,) to ``goal`` (k,) on which the two parts of ``checker`` were planned for one by
    one; None where they cannot get past each other. Arguments and errors are those of ``rrt_connect``."""
    samples = 0
    for turn in range(_PAIRS):
        run, ways = run._replace(seed=run.seed + turn), []
        for indices, alone in checker.parts:
            found = rrt_connect(alone, bounds[indices], start[indices], goal[indices], run, reach)
            samples += found.samples
            ways.append(shorten(found, alone, run).points)
        points = _at_once(checker.parts, ways)
        if all(checker.edge(a, b) for a, b in itertools.pairwise(points)):
            return Path(points, samples)
        points = _past_each_other(checker, ways)
        if points is not None:
            return Path(points, samples)
    return None


def _at_once(parts, ways):
    """The points (m, k) of both parts beginning and ending at the same time."""
    lengths = [np.append(0.0, np.linalg.norm(np.diff(way, axis=0), axis=1).cumsum()) for way in ways]
    shares = [along / along[-1] if along[-1] > 0.0 else np.linspace(0.0, 1.0, len(along)) for along in lengths]
    when = np.unique(np.concatenate(shares))
    points = np.empty((len(when), sum(way.shape[1] for way in ways)))
    for (indices, _), way, share in zip(parts, ways, shares, strict=True):
        for column, values in zip(indices, way.T, strict=True):
            points[:, column] = np.interp(when, share, values)
    return points


def _past_each_other(checker, ways):
    """The points (m, k) of the two parts moving along their ways, one waiting or going back for the other where it has
    to; None where that does not help."""
    (one, _), (other, _) = checker.parts
    first, second = map(_dense, ways)
    grid = np.empty((len(first), len(second), len(one) + len(other)))
    grid[:, :, one], grid[:, :, other] = first[:, None], second
    free = checker.valid(grid.reshape(-1, grid.shape[2])).reshape(grid.shape[:2])
    # Whoever asks knows that both ends are free.
    free[0, 0] = free[-1, -1] = True
    closed = np.zeros((*free.shape, 9), dtype=np.bool_)
    for _ in range(_TURNS):
        cells = kernels.way_through(free, closed)
        points = grid[cells[:, 0], cells[:, 1]]
        bad = [k for k in range(len(cells) - 1) if not checker.edge(points[k], points[k + 1])]
        if not bad:
            return points if len(points) else None
        for k in bad:
            (i, j), (di, dj) = cells[k], cells[k + 1] - cells[k]
            closed[i, j, 3 * di + dj + 4] = closed[i + di, j + dj, 4 - 3 * di - dj] = True
    return None


def _dense(way):
    """The way (m, j) with points added between its corners."""
    pieces = []
    for a, b in itertools.pairwise(way):
        count = max(1, int(np.ceil(np.linalg.norm(b - a) / _SPACING)))
        pieces.append(a + (b - a) * (np.arange(count) / count)[:, None])
    return np.concatenate([*pieces, way[-1:]])

