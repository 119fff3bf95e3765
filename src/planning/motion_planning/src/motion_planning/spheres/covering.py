# SPDX-License-Identifier: BSD-3-Clause
"""The compiled inner loops of covers: distances between many points, and the greedy choice of balls.

Points (3 * room,) float32 are stored axis by axis; room is a multiple of 16, and what is not used is infinite.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from motion_planning.lanes import below, fill, least, load, store
from motion_planning.spheres.compiled import compiled

if TYPE_CHECKING:
    from motion_planning.lanes import Vector

_FAR = np.float32(np.inf)


def by_axes(points: np.ndarray) -> np.ndarray:
    """Return ``points`` (n, 3) as these functions take them; n must be passed with them."""
    room = max(16, len(points) + -len(points) % 16)
    flat = np.full((3, room), _FAR, dtype=np.float32)
    flat[:, : len(points)] = np.transpose(points)
    return flat.ravel()


@compiled
def _squares(points: np.ndarray, begin: int, x: np.float32, y: np.float32, z: np.float32) -> Vector:
    """The squared distances of 16 points from a point."""
    room = len(points) // 3
    dx = load(points, begin) - fill(x)
    dy = load(points, room + begin) - fill(y)
    dz = load(points, 2 * room + begin) - fill(z)
    return dx * dx + dy * dy + dz * dz


@compiled
def _count(points: np.ndarray, count: int, ball: np.ndarray) -> int:
    """How many of the first ``count`` points lie in ``ball`` (4,): its centre and squared radius."""
    x, y, z, limit = ball[0], ball[1], ball[2], fill(ball[3])
    total = 0
    for begin in range(0, count, 16):
        bits = below(_squares(points, begin, x, y, z), limit)
        while bits:
            bits &= bits - 1
            total += 1
    return total


@compiled
def _part(points: np.ndarray, count: int, ball: np.ndarray, inside: np.ndarray) -> tuple[int, int]:
    """Move those of the first ``count`` points that lie in ``ball`` into ``inside``; return how many, how many stay."""
    x, y, z, limit = ball[0], ball[1], ball[2], fill(ball[3])
    room = len(points) // 3
    taken, left = 0, 0
    for begin in range(0, count, 16):
        bits = below(_squares(points, begin, x, y, z), limit)
        for lane in range(min(16, count - begin)):
            for axis in range(0, 3 * room, room):
                value = points[axis + begin + lane]
                if bits >> lane & 1:
                    inside[axis + taken] = value
                else:
                    points[axis + left] = value
            if bits >> lane & 1:
                taken += 1
            else:
                left += 1
    for axis in range(0, 3 * room, room):
        for k in range(taken, min(room, taken + 16)):
            inside[axis + k] = _FAR
        for k in range(left, min(room, left + 16)):
            points[axis + k] = _FAR
    return taken, left


@compiled
def choose(points: np.ndarray, count: int, balls: np.ndarray, chosen: np.ndarray) -> tuple[int, int]:
    """Write into ``chosen`` (m,) int64 the indices of ``balls`` (m, 4) float32, centre and squared radius, that
    together contain the first ``count`` points; each is the one that contains most of those that are left.

    ``points`` is overwritten. Returns the number of chosen ones and that of the points that are in no ball.
    """
    gains = np.empty(len(balls), np.int64)
    for c in range(len(balls)):
        gains[c] = _count(points, count, balls[c])
    inside = np.empty_like(points)
    number = 0
    while count:
        best = np.argmax(gains)
        if gains[best] <= 0:
            break
        chosen[number] = best
        number += 1
        taken, count = _part(points, count, balls[best], inside)
        gains[best] = 0
        reach = np.sqrt(balls[best, 3])
        for c in range(len(balls)):
            if gains[c] == 0:
                continue
            apart = np.float32(0.0)
            for axis in range(3):
                apart += (balls[c, axis] - balls[best, axis]) ** 2
            if apart < (reach + np.sqrt(balls[c, 3])) ** 2:
                gains[c] -= _count(inside, taken, balls[c])
    return number, count


@compiled
def within(points: np.ndarray, spheres: np.ndarray, beyond: float, starts: np.ndarray, members: np.ndarray,
           apart: np.ndarray) -> int:
    """Which of ``points`` (n, 3) lie in which of ``spheres`` (m, 4), by the distance from the centre and ``beyond``.

    Fills starts (m + 1,) with where the points of each sphere begin in members and apart, and these with the indices
    and distances of as many as there is room for. Returns their number.
    """
    count = 0
    for k in range(len(spheres)):
        starts[k] = count
        x, y, z, radius = spheres[k, 0], spheres[k, 1], spheres[k, 2], spheres[k, 3]
        for i in range(len(points)):
            dx, dy, dz = points[i, 0] - x, points[i, 1] - y, points[i, 2] - z
            far = np.sqrt(dx * dx + dy * dy + dz * dz) + beyond
            if far <= radius:
                if count < len(members):
                    members[count], apart[count] = i, far
                count += 1
    starts[len(spheres)] = count
    return count


@compiled
def nearest(points: np.ndarray, count: int, places: np.ndarray, found: np.ndarray) -> None:
    """Write into ``found`` (m,) float32 the distance of each of ``places`` (m, 3) float32 from the nearest of the first
    ``count`` points."""
    lane = np.empty(16, np.float32)
    for m in range(len(places)):
        best = fill(_FAR)
        for begin in range(0, count, 16):
            best = least(best, _squares(points, begin, places[m, 0], places[m, 1], places[m, 2]))
        store(lane, 0, best)
        found[m] = np.sqrt(lane.min())


@compiled
def ball(spheres: np.ndarray, steps: int) -> np.ndarray:
    """Return (4,): a ball around all ``spheres`` (n, 4), made smaller by ``steps`` towards the farthest sphere."""
    centre, best = np.empty(3), np.empty(4)
    for axis in range(3):
        low, high = math.inf, -math.inf
        for row in spheres:
            low, high = min(low, row[axis] - row[3]), max(high, row[axis] + row[3])
        centre[axis] = 0.5 * (low + high)
    best[:3], best[3] = centre, math.inf
    for turn in range(steps):
        far, reach = 0, -1.0
        for number in range(len(spheres)):
            x, y, z, radius = spheres[number]
            here = math.sqrt((x - centre[0])**2 + (y - centre[1])**2 + (z - centre[2])**2) + radius
            if here > reach:
                far, reach = number, here
        if reach < best[3]:
            best[:3], best[3] = centre, reach
        for axis in range(3):
            centre[axis] += (spheres[far, axis] - centre[axis]) / (turn + 2.0)
    return best
