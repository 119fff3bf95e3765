# SPDX-License-Identifier: BSD-3-Clause
"""Arms of one group planned for one by one, and their paths brought together.

Two arms get into each other's way at few of their postures. An arm alone has half the joints, and a path of all arms
needs a path of each alone: what is found so is found much sooner, and what is not there need not be looked for in the
space of all joints.
"""
import itertools

import numpy as np

from motion_planning.planners.trees import Path, rrt_connect, shorten


def apart(checker, bounds, start, goal, run, reach):
    """Return a Path from ``start`` (k,) to ``goal`` (k,) on which the parts of ``checker``, at least two, were planned
    for one by one; None where they get into each other's way. Arguments and errors are those of ``rrt_connect``."""
    ways, samples = [], 0
    for indices, alone in checker.parts:
        found = rrt_connect(alone, bounds[indices], start[indices], goal[indices], run, reach)
        samples += found.samples
        ways.append(shorten(found, alone, run).points)
    for points in _together([indices for indices, _ in checker.parts], ways):
        if all(checker.edge(a, b) for a, b in itertools.pairwise(points)):
            return Path(points, samples)
    return None


def _together(parts, ways):
    """Yield paths (m, k) made of a path of each part: all at once, then one after the other in each order."""
    lengths = [np.append(0.0, np.linalg.norm(np.diff(way, axis=0), axis=1).cumsum()) for way in ways]
    # Where along its own way each part is, from 0 to 1, at each of its corners.
    shares = [along / along[-1] if along[-1] > 0.0 else along for along in lengths]
    count = sum(map(len, parts))
    yield _at(parts, ways, shares, [np.unique(np.concatenate([*shares, [0.0, 1.0]]))] * len(parts), count)
    for order in itertools.permutations(range(len(parts))):
        pieces = [[] for _ in parts]
        for moving in order:
            for part, piece in enumerate(pieces):
                done = float(order.index(part) < order.index(moving))
                piece.append(shares[moving][1:] if part == moving else np.full(len(shares[moving]) - 1, done))
        yield _at(parts, ways, shares, [np.concatenate([[0.0], *piece]) for piece in pieces], count)


def _at(parts, ways, shares, when, count):
    """The points (m, count) at which each part is so far along its way as ``when`` (m,) says."""
    points = np.empty((len(when[0]), count))
    for indices, way, share, along in zip(parts, ways, shares, when, strict=True):
        for column, values in zip(indices, way.T, strict=True):
            points[:, column] = np.interp(along, share, values)
    return points
