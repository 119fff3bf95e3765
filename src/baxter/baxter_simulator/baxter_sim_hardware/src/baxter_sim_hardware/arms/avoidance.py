# SPDX-License-Identifier: BSD-3-Clause
"""The field that keeps the arms away from the head, and from each other: it slows approaching arms and stops them.

The description has two balls around the head. They are not bodies: nothing collides with them. An arm is modelled as a
chain of capsules from elbow to tip, as thick as its links. When the commanded motion would bring a capsule nearer to a
ball, all joints of the arm are slowed, so that the approach speed is at most proportional to the gap. Motion away is
free. With the effect `safety` the capsules of the other arm, and blocks in place of the torso and its pedestal, are
approached in the same way.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from baxter_model import self_collision
from disk_cache.compiled import compiler

_compiled = compiler("baxter_sim_hardware", [__file__, self_collision.__file__], error_model="numpy")

# [s] The approach speed is at most the gap divided by this time: an elbow at 1 m/s is slowed from 0.15 m on, by less
# than the set-points' own deceleration.
CLOSING_S = 0.15
FIELD_M = 0.03  # within this distance of a guard, an arm counts as being in the field
# The links from this joint on are the chain of capsules.
FIRST_JOINT = self_collision.FIRST_AVOIDING


class Guards(NamedTuple):
    """k balls: their names, centres (k, 3) in the base frame [m], radii (k,) with the arms' own thickness [m]."""

    names: tuple
    centres: np.ndarray
    radii: np.ndarray


class Blocks(NamedTuple):
    """k boxes along the axes of the base frame, in place of the body: names of their links, (k,); the joint before the
    first link of an arm that is kept away from each, (k,) counted from 0; their corners with the least and with the
    greatest coordinates, (k, 2, 3) [m]."""

    links: tuple
    first: np.ndarray
    corners: np.ndarray


class Field(NamedTuple):
    """The result for one arm: names of the near guards, the share of its speed, 0 to 1, that it may keep, names of the
    near links of the other arm, and of the body."""

    near: tuple
    slowing: float
    other: tuple = ()
    body: tuple = ()


FREE = Field((), 1.0)


def field(guards: Guards, rotations: np.ndarray, origins: np.ndarray, rates: np.ndarray) -> Field:
    """The `Field` of an arm.

    rotations (n + 1, 3, 3), origins (n + 1, 3): frames in base of its joints, whose z are the axes, and of the tip;
    rates (n,): the speeds at which its joints would move [rad/s].
    """
    if not guards.names:
        return FREE
    distances, nearest, slowing = _distances(guards.centres, guards.radii, rotations, origins, rates)
    if nearest >= FIELD_M:
        return Field((), slowing)
    return Field(tuple(name for name, distance in zip(guards.names, distances, strict=True) if distance < FIELD_M),
                 slowing)


@_compiled
def _distances(centres: np.ndarray, radii: np.ndarray, rotations: np.ndarray, origins: np.ndarray,
               rates: np.ndarray) -> tuple[np.ndarray, float, float]:
    """((k,) distances of the balls from the arm [m], negative inside; the least of them; the share of its speed that an
    arm may have)."""
    distances, slowing = np.full(len(centres), np.inf), 1.0
    near, to_centre = np.empty(3), np.empty(3)  # once: an array for each link would take longer than the sums
    for ball in range(len(centres)):
        for link in range(FIRST_JOINT, len(origins) - 1):
            length = along = 0.0
            for a in range(3):
                step = origins[link + 1, a] - origins[link, a]
                length += step * step
                along += step * (centres[ball, a] - origins[link, a])
            part = min(max(along / length, 0.0), 1.0) if length > 0.0 else 0.0
            reach = 0.0
            for a in range(3):
                near[a] = origins[link, a] + part * (origins[link + 1, a] - origins[link, a])
                to_centre[a] = centres[ball, a] - near[a]
                reach += to_centre[a] * to_centre[a]
            reach = math.sqrt(reach)
            distance = reach - radii[ball]
            distances[ball] = min(distances[ball], distance)
            left = distance, reach, CLOSING_S
            slowing = min(slowing, _share(rotations, origins, rates, link, near, to_centre, left))
    return distances, distances.min(), slowing


def between(own: tuple[np.ndarray, np.ndarray], other: tuple[np.ndarray, np.ndarray], rates: np.ndarray, apart: float,
            closing_s: float) -> tuple[np.ndarray, float]:
    """How one arm is kept away from the other.

    own, other: (rotations (n + 1, 3, 3), origins (n + 1, 3)) as for `field`; rates (n,): the speeds at which its own
    joints would move [rad/s]; apart: distance of their middle lines at which they are stopped [m]; closing_s: an
    approach is at most as fast as the rest of the distance divided by this [s].

    Returns ((n,) distance that is left to each link of the other [m], inf for those before the elbow; the share of its
    speed that the arm may have).
    """
    return _between(*own, other[1], rates, apart, closing_s)


@_compiled
def _between(rotations: np.ndarray, origins: np.ndarray, others: np.ndarray, rates: np.ndarray, apart: float,
             closing_s: float) -> tuple[np.ndarray, float]:
    left, slowing = np.full(len(others) - 1, np.inf), 1.0
    for link in range(FIRST_JOINT, len(origins) - 1):
        for other in range(FIRST_JOINT, len(others) - 1):
            s, t = _nearest(origins[link], origins[link + 1], others[other], others[other + 1])
            near = origins[link] + s * (origins[link + 1] - origins[link])
            to_other = others[other] + t * (others[other + 1] - others[other]) - near
            reach = math.sqrt(to_other[0] ** 2 + to_other[1] ** 2 + to_other[2] ** 2)
            rest = reach - apart
            left[other] = min(left[other], rest)
            slowing = min(slowing, _share(rotations, origins, rates, link, near, to_other, (rest, reach, closing_s)))
    return left, slowing


@_compiled
def _share(rotations: np.ndarray, origins: np.ndarray, rates: np.ndarray, link: int, near: np.ndarray, away: np.ndarray,
           distance: tuple[float, float, float]) -> float:
    """The share of its speed that an arm may have whose `link` has the point `near` (3,) [m], with a thing at near +
    away (3,) [m]; distance: (what is left of it [m], it [m], least time of the approach [s])."""
    rest, reach, closing_s = distance
    closing = 0.0
    for joint in range(link + 1):
        ax, ay, az = rotations[joint, 0, 2], rotations[joint, 1, 2], rotations[joint, 2, 2]
        px, py, pz = near[0] - origins[joint, 0], near[1] - origins[joint, 1], near[2] - origins[joint, 2]
        closing += rates[joint] * (away[0] * (ay * pz - az * py) + away[1] * (az * px - ax * pz)
                                   + away[2] * (ax * py - ay * px))
    closing /= max(reach, 1e-9)
    allowed = max(rest, 0.0) / closing_s
    return allowed / closing if closing > allowed else 1.0


def around(blocks: Blocks, own: tuple[np.ndarray, np.ndarray], rates: np.ndarray, apart: float,
           closing_s: float) -> tuple[np.ndarray, float]:
    """How one arm is kept away from the body.

    blocks: `Blocks`; own, rates, apart, closing_s: as for `between`. Returns ((k,) distance that is left to each block
    [m]; the share of its speed that the arm may have). Where the arm's middle line is within a block, it may move
    freely: only a stream of raw positions, torques, or a client who suppresses avoidance takes it there.
    """
    return _around(blocks.first, blocks.corners, *own, rates, apart, closing_s)


@_compiled
def _around(first: np.ndarray, corners: np.ndarray, rotations: np.ndarray, origins: np.ndarray, rates: np.ndarray,
            apart: float, closing_s: float) -> tuple[np.ndarray, float]:
    left, slowing = np.full(len(corners), np.inf), 1.0
    near, away = np.empty(3), np.empty(3)
    for link in range(FIRST_JOINT, len(origins) - 1):
        for block in range(len(corners)):
            if link < first[block]:
                continue
            part = _nearest_to_box(origins[link], origins[link + 1], corners[block])
            square = 0.0
            for i in range(3):
                near[i] = origins[link, i] + part * (origins[link + 1, i] - origins[link, i])
                away[i] = min(max(near[i], corners[block, 0, i]), corners[block, 1, i]) - near[i]
                square += away[i] * away[i]
            reach = math.sqrt(square)
            rest = reach - apart
            left[block] = min(left[block], rest)
            slowing = min(slowing, _share(rotations, origins, rates, link, near, away, (rest, reach, closing_s)))
    return left, slowing


@_compiled
def _nearest_to_box(a: np.ndarray, b: np.ndarray, corners: np.ndarray) -> float:
    """The share of the line from a to b, 0 to 1, at which it is nearest to a box.

    The distance is convex along the line: its slope's zero is searched by bisection, to 1/1000 of the line's length.
    """
    low, high = 0.0, 1.0
    for _ in range(10):
        middle = 0.5 * (low + high)
        slope = 0.0
        for i in range(3):
            along = b[i] - a[i]
            p = a[i] + middle * along
            slope += along * (p - min(max(p, corners[0, i]), corners[1, i]))
        if slope > 0.0:
            high = middle
        else:
            low = middle
    return 0.5 * (low + high)


@_compiled
def _nearest(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> tuple[float, float]:
    """Where two lines, from a to b and from c to d, are nearest to each other: shares of their lengths, 0 to 1."""
    first = second = along = to_first = to_second = 0.0
    for i in range(3):
        u, v, w = b[i] - a[i], d[i] - c[i], a[i] - c[i]
        first += u * u
        second += v * v
        along += u * v
        to_first += u * w
        to_second += v * w
    first, second = max(first, 1e-12), max(second, 1e-12)
    wide = first * second - along * along
    s = min(max((along * to_second - to_first * second) / wide, 0.0), 1.0) if wide > 1e-12 else 0.0
    t = (along * s + to_second) / second
    if not 0.0 <= t <= 1.0:
        t = min(max(t, 0.0), 1.0)
        s = min(max((along * t - to_first) / first, 0.0), 1.0)
    return s, t
