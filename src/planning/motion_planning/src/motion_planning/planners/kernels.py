# SPDX-License-Identifier: BSD-3-Clause
"""The compiled inner loops of planning: two trees that grow towards each other, and shortcuts.

Trees are kept variable by variable, so that distances to 16 nodes are computed at once: ``nodes`` (2, k, room)
float32, room a multiple of 16; ``parents`` (2, room) int32, -1 for a root. ``numbers`` (7) int64 is the state between
calls: 0, 1 the trees' sizes; 2 the tree that grows; 3 the random state; 4, 5 the two nodes at which they met; 6 the
number of drawn samples.
"""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from motion_planning.lanes import below, fill, load, store
from motion_planning.spheres.compiled import compiled
from motion_planning.spheres.kernel import free_edge, work_arrays

if TYPE_CHECKING:
    from motion_planning.planners.trees import Trees
    from motion_planning.spheres.kernel import Tables

GOING_ON, MET, FULL = range(3)


@compiled
def random_bits(numbers: np.ndarray) -> np.uint64:
    """The next of a sequence of 64 random bits: xorshift* (Vigna 2016)."""
    x = np.uint64(numbers[3])
    x ^= x >> np.uint64(12)
    x ^= x << np.uint64(25)
    x ^= x >> np.uint64(27)
    numbers[3] = np.int64(x)
    return x * np.uint64(2685821657736338717)


@compiled
def random_unit(numbers: np.ndarray) -> np.float32:
    """A random number from 0 up to 1."""
    return np.float32(random_bits(numbers) >> np.uint64(40)) * np.float32(2.0 ** -24)


@compiled
def nearest(nodes: np.ndarray, tree: int, count: int, target: np.ndarray,
            distances: np.ndarray) -> tuple[int, np.float32]:
    """Return (index, squared distance) of the node of a tree that is nearest to ``target`` (k,)."""
    k, room = nodes.shape[1], nodes.shape[2]
    flat = nodes.ravel()
    best, least = 0, np.float32(np.inf)
    for begin in range(0, count, 16):
        total = fill(np.float32(0.0))
        for j in range(k):
            apart = load(flat, (tree * k + j) * room + begin) - fill(target[j])
            total = total + apart * apart
        if below(total, fill(least)) == 0:
            continue
        store(distances, 0, total)
        for lane in range(min(16, count - begin)):
            if distances[lane] < least:
                best, least = begin + lane, distances[lane]
    return best, least


@compiled
def _add(trees: Trees, tree: int, q: np.ndarray, parent: int) -> int:
    nodes, parents, numbers = trees
    count = numbers[tree]
    for j in range(len(q)):
        nodes[tree, j, count] = q[j]
    parents[tree, count] = parent
    numbers[tree] = count + 1
    return count


@compiled
def grow(tables: Tables, trees: Trees, bounds: tuple[np.ndarray, np.ndarray], reach: float, step: float,
         samples: int) -> int:
    """Draw up to ``samples`` samples. Return MET, FULL (no room for more nodes) or GOING_ON.

    tables: of the checker. trees: (nodes, parents, numbers). bounds: (low, high), (k,) float32 each. ``reach``: the
    longest edge; ``step``: distance of checked states on an edge.
    """
    nodes, parents, numbers = trees
    low, high = bounds
    k = nodes.shape[1]
    room = nodes.shape[2]
    work = work_arrays(tables[0])
    distances = np.empty(16, np.float32)
    sample, new, at = np.empty(k, np.float32), np.empty(k, np.float32), np.empty(k, np.float32)
    for _ in range(samples):
        if numbers[0] + 1 >= room or numbers[1] + 1 >= room:
            return FULL
        # The smaller tree grows.
        tree = 0 if numbers[0] <= numbers[1] else 1
        if numbers[0] == numbers[1]:
            tree = numbers[2]
            numbers[2] = 1 - tree
        numbers[6] += 1
        for j in range(k):
            sample[j] = low[j] + (high[j] - low[j]) * random_unit(numbers)
        parent, square = nearest(nodes, tree, numbers[tree], sample, distances)
        length = np.sqrt(square)
        share = min(np.float32(1.0), reach / length) if length > 0 else np.float32(0.0)
        for j in range(k):
            at[j] = nodes[tree, j, parent]
            new[j] = at[j] + share * (sample[j] - at[j])
        if not free_edge(tables, work, at, new, step):
            continue
        added = _add(trees, tree, new, parent)
        # The other tree grows towards the new node as far as possible.
        other = 1 - tree
        parent, square = nearest(nodes, other, numbers[other], new, distances)
        length = np.sqrt(square)
        parts = max(1, int(np.ceil(length / reach)))
        for part in range(parts):
            if numbers[other] + 1 >= room:
                return FULL
            for j in range(k):
                at[j] = nodes[other, j, parent]
                sample[j] = at[j] + (new[j] - at[j]) / np.float32(parts - part)
            if not free_edge(tables, work, at, sample, step):
                break
            if part == parts - 1:
                numbers[4 + tree], numbers[4 + other] = added, parent
                return MET
            parent = _add(trees, other, sample, parent)
    return GOING_ON


@compiled
def _point(path: np.ndarray, lengths: np.ndarray, along: float, out: np.ndarray) -> int:
    """Write the point ``along`` the path into ``out`` (k,) and return the index of the corner before it."""
    i = 0
    while i < len(lengths) - 2 and lengths[i + 1] <= along:
        i += 1
    piece = lengths[i + 1] - lengths[i]
    share = (along - lengths[i]) / piece if piece > 0 else np.float32(0.0)
    for j in range(path.shape[1]):
        out[j] = path[i, j] + share * (path[i + 1, j] - path[i, j])
    return i


@compiled
def _length(path: np.ndarray, i: int, o: int) -> float:
    total = np.float32(0.0)
    for j in range(path.shape[1]):
        total += (path[i, j] - path[o, j]) ** 2
    return np.sqrt(total)


@compiled
def _without_idle(path: np.ndarray, count: int) -> int:
    """Take points out that lie on the line between their neighbours. Returns the new count."""
    kept = 1
    for i in range(1, count - 1):
        if _length(path, kept - 1, i) + _length(path, i, i + 1) - _length(path, kept - 1, i + 1) > np.float32(1e-6):
            path[kept] = path[i]
            kept += 1
    path[kept] = path[count - 1]
    return kept + 1


@compiled
def shortcut(tables: Tables, path: np.ndarray, count: int, numbers: np.ndarray, step: float,
             effort: tuple[int, int, float]) -> int:
    """Shorten a path in place between two random points of it, if that is free and saves enough: all joints on a
    straight line, or one random joint while the others stay on their way (Geraerts and Overmars 2007).

    path (room, k), of which the first ``count`` rows count; each success adds at most 2 rows. effort: the number of
    tries, that of misses in a row which ends them, and the share of tries with one joint. Returns the new count.
    """
    tries, misses, single = effort
    room, k = path.shape
    work = work_arrays(tables[0])
    a, b = np.empty(k, np.float32), np.empty(k, np.float32)
    lengths, piece = np.empty(room, np.float32), np.empty((room, k), np.float32)
    saved = np.float32(1e-3) if single == 0.0 else np.float32(1e-4)  # of the whole length: one joint saves less
    missed = 0
    lengths[0] = np.float32(0.0)
    known = 1  # number of valid entries in lengths
    for _ in range(tries):
        for i in range(known, count):
            lengths[i] = lengths[i - 1] + _length(path, i, i - 1)
        known = count
        whole = lengths[count - 1]
        first, second = random_unit(numbers) * whole, random_unit(numbers) * whole
        if first > second:
            first, second = second, first
        i = _point(path, lengths[:count], first, a)
        o = _point(path, lengths[:count], second, b)
        if i == o:
            continue
        # Corners i + 1 ... o give way to the points of ``piece``.
        piece[0] = a
        size = 2
        if single > 0.0 and random_unit(numbers) < single:
            size = o - i + 2
            joint = min(k - 1, int(random_unit(numbers) * np.float32(k)))
            for c in range(1, size - 1):
                piece[c] = path[i + c]
                piece[c, joint] = a[joint] + (lengths[i + c] - first) / (second - first) * (b[joint] - a[joint])
        piece[size - 1] = b
        change = size - (o - i)
        direct = np.float32(0.0)
        for c in range(1, size):
            direct += _length(piece, c - 1, c)
        free = second - first - direct >= saved * whole and count + change <= room
        for c in range(1, size):
            free = free and free_edge(tables, work, piece[c - 1], piece[c], step)
        if not free:
            missed += 1
            if missed >= misses:
                break
            continue
        missed = 0
        if change > 0:
            for row in range(count - 1, o, -1):
                path[row + change] = path[row]
        elif change < 0:
            for row in range(o + 1, count):
                path[row + change] = path[row]
        for c in range(size):
            path[i + 1 + c] = piece[c]
        count += change
        known = i + 1
        if single > 0.0:
            count = _without_idle(path, count)
            known = 1
    return count


@compiled
def _shares(way: np.ndarray) -> np.ndarray:
    """The share of the length of ``way`` (n, j) before each of its points; of their number if it has no length."""
    shares = np.zeros(len(way))
    for i in range(1, len(way)):
        shares[i] = shares[i - 1] + np.sqrt(np.square(way[i] - way[i - 1]).sum())
    return shares / shares[-1] if shares[-1] > 0.0 else np.arange(len(way)) / max(1, len(way) - 1)


@compiled
def _write_point(way: np.ndarray, shares: np.ndarray, i: int, share: float, out: np.ndarray) -> int:
    """Write the point at a share of the length into ``out``; i: of the last corner before it. Returns i."""
    while i < len(shares) - 2 and shares[i + 1] <= share:
        i += 1
    # A piece of no length has nothing to divide by, and nowhere to go.
    along = min(1.0, (share - shares[i]) / max(shares[i + 1] - shares[i], 1e-12))
    for j in range(way.shape[1]):
        out[j] = way[i, j] + along * (way[i + 1, j] - way[i, j])
    return i


@compiled
def at_once(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return (m, j + k): the points of two paths (n, j) and (l, k), n, l > 1, that begin and end at the same time, with
    the corners of both."""
    first, second = _shares(one), _shares(other)
    points = np.empty((len(one) + len(other), one.shape[1] + other.shape[1]))
    count, a, b, i, o = 0, 0, 0, 0, 0
    while a < len(one) or b < len(other):
        if b == len(other) or a < len(one) and first[a] <= second[b]:
            share = first[a]
        else:
            share = second[b]
        while a < len(one) and first[a] <= share:
            a += 1
        while b < len(other) and second[b] <= share:
            b += 1
        i = _write_point(one, first, i, share, points[count, : one.shape[1]])
        o = _write_point(other, second, o, share, points[count, one.shape[1] :])
        count += 1
    return points[:count]


@compiled
def way_through(free: np.ndarray, closed: np.ndarray) -> np.ndarray:
    """Return cells (m, 2) of a shortest path from the first to the last cell of ``free`` (a, b) bool; (0, 2) if there
    is none.

    A step leads to one of the eight cells around; ``closed`` (a, b, 9): steps by (di, dj) that are forbidden, at
    3 di + dj + 4.
    """
    rows, columns = free.shape
    before = np.full(rows * columns, -1, np.int64)
    queue = np.empty(rows * columns, np.int64)
    goal = rows * columns - 1
    queue[0], before[0] = 0, 0
    taken, known = 0, 1
    while taken < known and before[goal] < 0:
        cell = queue[taken]
        taken += 1
        i, j = cell // columns, cell % columns
        # Forwards together first, last back together.
        for step in (8, 7, 5, 6, 2, 3, 1, 0):
            u, v = i + step // 3 - 1, j + step % 3 - 1
            if u < 0 or v < 0 or u >= rows or v >= columns or not free[u, v] or closed[i, j, step]:
                continue
            if before[u * columns + v] < 0:
                before[u * columns + v] = cell
                queue[known] = u * columns + v
                known += 1
    count, cell = 0, goal
    while before[goal] >= 0:
        queue[count] = cell
        count += 1
        if cell == 0:
            break
        cell = before[cell]
    cells = np.empty((count, 2), np.int64)
    for k in range(count):
        cell = queue[count - 1 - k]
        cells[k, 0], cells[k, 1] = cell // columns, cell % columns
    return cells


@compiled
def between_checked(points: np.ndarray, resolution: float) -> tuple[np.ndarray, np.ndarray]:
    """Return (states (m, k), indices of the corners): the corners ``points`` (n, k) of a path, and what lies halfway
    between the states on its lines that the search has checked, which are at most ``resolution`` apart."""
    count, k = points.shape
    corners = np.zeros(count, np.int64)
    for i in range(1, count):
        steps = max(1, int(np.ceil(np.sqrt(np.square(points[i] - points[i - 1]).sum()) / resolution)))
        corners[i] = corners[i - 1] + steps + 1
    states = np.empty((corners[-1] + 1, k))
    for i in range(count):
        states[corners[i]] = points[i]
        if i + 1 < count:
            steps = corners[i + 1] - corners[i] - 1
            for number in range(steps):
                share = (number + 0.5) / steps
                for j in range(k):
                    states[corners[i] + 1 + number, j] = points[i, j] + share * (points[i + 1, j] - points[i, j])
    return states, corners


@compiled
def traced(nodes: np.ndarray, parents: np.ndarray, numbers: np.ndarray) -> np.ndarray:
    """Return the points (m, k) from the first tree's root through the meeting point to a root of the second; the
    meeting point appears once."""
    counts = np.zeros(2, np.int64)
    for tree in range(2):
        node = numbers[4 + tree]
        while node >= 0:
            counts[tree] += 1
            node = parents[tree, node]
    points = np.empty((counts[0] + counts[1], nodes.shape[1]))
    for tree in range(2):
        node, at = numbers[4 + tree], counts[0] - 1 + tree
        while node >= 0:
            for j in range(nodes.shape[1]):
                points[at, j] = nodes[tree, j, node]
            at += 2 * tree - 1
            node = parents[tree, node]
    return points
