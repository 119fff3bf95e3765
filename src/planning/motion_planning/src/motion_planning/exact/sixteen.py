# SPDX-License-Identifier: BSD-3-Clause
"""Sixteen postures at once: which shapes are near each other in which of them.

All in single floats, about the robot's base, with a margin for their rounding; ``kernels`` looks at what is near in
double floats. ``frames`` (192 l,): row by row the (3, 4) of each link's frame, ``spots`` (48 m,): x, y, z of each
mover's centre, sixteen lanes each.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from motion_planning.exact.apart import compiled
from motion_planning.lanes import below, fill, greatest, load, magnitude, sine_and_cosine, store

if TYPE_CHECKING:
    from motion_planning.exact.kernels import FixedArrays, MoverArrays
    from motion_planning.lanes import Vector
    from motion_planning.model.kernels import Kinematics

# Rounding of single floats [m], and in parts of distances from the base: some thirty steps of 6e-8 each.
_ROUNDING_M, _ROUNDING = 1e-4, 4e-6
_NONE = np.float32(0.0)
_ROOM = 256


@compiled
def place_sixteen(kinematics: Kinematics, turn: np.ndarray, postures: np.ndarray, movers: MoverArrays,
                  frames: np.ndarray, spots: np.ndarray) -> float:
    """Write the ``frames`` and ``spots`` of up to sixteen ``postures`` (p, n); the last one stands in for those that
    are missing. turn (3, 3): of the base. Returns the margin [m] for the rounding of distances between movers."""
    parents, origins, axes, kinds, variables, factors = kinematics
    of_links, inner, radii = movers[0], movers[6], movers[4]
    moved = np.empty(16, np.float32)
    last, reach = len(postures) - 1, 0.0
    for link in range(len(parents)):
        origin, kind, variable = origins[link], kinds[link], variables[link]
        reach += abs(origin[0, 3]) + abs(origin[1, 3]) + abs(origin[2, 3])
        most = 0.0
        for lane in range(16):
            value = factors[link, 1]
            if variable >= 0:
                value += factors[link, 0] * postures[min(lane, last), variable]
            if kind == 1:
                value -= 2.0 * math.pi * np.floor(value / (2.0 * math.pi) + 0.5)
            most = max(most, abs(value))
            moved[lane] = value
        if kind == 2:
            reach += most
        _place_link((link, parents[link], kind), (origin, axes[link], turn), moved, frames)
    for i in range(len(of_links)):
        at = 192 * of_links[i]
        x, y, z = fill(np.float32(inner[i, 0])), fill(np.float32(inner[i, 1])), fill(np.float32(inner[i, 2]))
        for a in range(3):
            row = at + 64 * a
            store(spots, 48 * i + 16 * a, load(frames, row) * x + load(frames, row + 16) * y
                  + load(frames, row + 32) * z + load(frames, row + 48))
    most = 0.0
    for i in range(len(radii)):
        most = max(most, radii[i] + abs(inner[i, 0]) + abs(inner[i, 1]) + abs(inner[i, 2]))
    return _ROUNDING_M + _ROUNDING * (reach + most)


@compiled
def _place_link(which: tuple[int, int, int], joint: tuple[np.ndarray, np.ndarray, np.ndarray], moved: np.ndarray,
                frames: np.ndarray) -> None:
    """Write the frame of a link. which: its index, its parent's, its joint's kind. joint: origin (4, 4), axis (3,),
    and turn (3, 3) of the base. moved (16,): the joint's value in each lane."""
    (link, parent, kind), (origin, axis, turn) = which, joint
    x, y, z = fill(np.float32(axis[0])), fill(np.float32(axis[1])), fill(np.float32(axis[2]))
    value = load(moved, 0)
    s, c = sine_and_cosine(value)
    rest = fill(np.float32(1.0)) - c
    for a in range(3):
        at = 192 * link + 64 * a
        if parent < 0:
            u, v, w = fill(np.float32(turn[a, 0])), fill(np.float32(turn[a, 1])), fill(np.float32(turn[a, 2]))
            place = fill(_NONE)
        else:
            up = 192 * parent + 64 * a
            u, v, w, place = load(frames, up), load(frames, up + 16), load(frames, up + 32), load(frames, up + 48)
        place = place + (u * fill(np.float32(origin[0, 3])) + v * fill(np.float32(origin[1, 3]))
                         + w * fill(np.float32(origin[2, 3])))
        u, v, w = (_column(u, v, w, origin, 0), _column(u, v, w, origin, 1), _column(u, v, w, origin, 2))
        if kind == 2:
            place = place + value * (u * x + v * y + w * z)
        elif kind == 1:
            # Rodrigues' formula, as in model.kernels.
            dot = rest * (u * x + v * y + w * z)
            u, v, w = (u * c + dot * x + s * (v * z - w * y), v * c + dot * y + s * (w * x - u * z),
                       w * c + dot * z + s * (u * y - v * x))
        store(frames, at, u)
        store(frames, at + 16, v)
        store(frames, at + 32, w)
        store(frames, at + 48, place)


@compiled
def _column(u: Vector, v: Vector, w: Vector, origin: np.ndarray, b: int) -> Vector:
    return (u * fill(np.float32(origin[0, b])) + v * fill(np.float32(origin[1, b]))
            + w * fill(np.float32(origin[2, b])))


@compiled
def near_each_other(places: tuple[np.ndarray, np.ndarray], movers: MoverArrays, checked: tuple[np.ndarray, np.ndarray],
                    fixed: FixedArrays, about: tuple[np.ndarray, float, int]) -> tuple[np.ndarray, int]:
    """Return (rows (r, 3), their number): two movers, or a mover and -1 - the fixed shape, and the mask of the lanes in
    which they may be near each other: the ball of one meets the box of the other. places: frames, spots. checked:
    pairs, movers that are checked against fixed shapes. about: the place (3,) of the base, the margin [m] of
    ``place_sixteen``, the mask of the lanes that count."""
    frames, spots = places
    pairs, active = checked
    place, margin, lanes = about
    radii = movers[4]
    turns, centres, sides, sizes, starts, balls, _ = fixed
    rows, count = np.empty((_ROOM, 3), np.int64), 0
    for k in range(len(pairs)):
        i, j = 48 * pairs[k, 0], 48 * pairs[k, 1]
        reach = np.float32(radii[pairs[k, 0]] + radii[pairs[k, 1]] + margin)
        x, y, z = (load(spots, i) - load(spots, j), load(spots, i + 16) - load(spots, j + 16),
                   load(spots, i + 32) - load(spots, j + 32))
        mask = below(x * x + y * y + z * z, fill(reach * reach)) & lanes
        if mask:
            mask &= _meets_box(frames, movers, pairs[k, 1], x, y, z, np.float32(radii[pairs[k, 0]] + margin))
        if mask:
            mask &= _meets_box(frames, movers, pairs[k, 0], x, y, z, np.float32(radii[pairs[k, 1]] + margin))
        if mask:
            if count == len(rows):
                rows = _twice(rows)
            rows[count, 0], rows[count, 1], rows[count, 2] = pairs[k, 0], pairs[k, 1], mask
            count += 1
    some = np.empty(len(active), np.int64)
    for chunk in range(len(balls)):
        found = 0
        cx, cy, cz = balls[chunk, 0] - place[0], balls[chunk, 1] - place[1], balls[chunk, 2] - place[2]
        wide = margin + balls[chunk, 3] + _ROUNDING * (abs(cx) + abs(cy) + abs(cz) + balls[chunk, 3])
        for i in active:
            x, y, z = (load(spots, 48 * i) - fill(np.float32(cx)), load(spots, 48 * i + 16) - fill(np.float32(cy)),
                       load(spots, 48 * i + 32) - fill(np.float32(cz)))
            reach = np.float32(radii[i] + wide)
            if below(x * x + y * y + z * z, fill(reach * reach)) & lanes:
                some[found] = i
                found += 1
        if found == 0:
            continue
        for k in range(starts[chunk], starts[chunk + 1]):
            cx, cy, cz = centres[k, 0] - place[0], centres[k, 1] - place[1], centres[k, 2] - place[2]
            wide = margin + _ROUNDING * (abs(cx) + abs(cy) + abs(cz) + sizes[k])
            for n in range(found):
                i = some[n]
                x, y, z = (load(spots, 48 * i) - fill(np.float32(cx)), load(spots, 48 * i + 16)
                           - fill(np.float32(cy)), load(spots, 48 * i + 32) - fill(np.float32(cz)))
                u, v, w = (_beyond(x, y, z, turns[k], sides[k], 0), _beyond(x, y, z, turns[k], sides[k], 1),
                           _beyond(x, y, z, turns[k], sides[k], 2))
                reach = np.float32(radii[i] + wide)
                mask = below(u * u + v * v + w * w, fill(reach * reach)) & lanes
                if mask:
                    if count == len(rows):
                        rows = _twice(rows)
                    rows[count, 0], rows[count, 1], rows[count, 2] = i, -1 - k, mask
                    count += 1
    return rows, count


@compiled
def _meets_box(frames: np.ndarray, movers: MoverArrays, i: int, x: Vector, y: Vector, z: Vector,
               radius: np.float32) -> int:
    """Mask of the lanes in which a ball, x, y, z away from the centre of mover ``i``'s box, meets that."""
    local, half, at = movers[1][i], movers[3][i], 192 * movers[0][i]
    u = (x * load(frames, at) + y * load(frames, at + 64)) + z * load(frames, at + 128)
    v = (x * load(frames, at + 16) + y * load(frames, at + 80)) + z * load(frames, at + 144)
    w = (x * load(frames, at + 32) + y * load(frames, at + 96)) + z * load(frames, at + 160)
    a, b, c = _beyond(u, v, w, local, half, 0), _beyond(u, v, w, local, half, 1), _beyond(u, v, w, local, half, 2)
    return below(a * a + b * b + c * c, fill(radius * radius))


@compiled
def _beyond(x: Vector, y: Vector, z: Vector, turn: np.ndarray, half: np.ndarray, axis: int) -> Vector:
    """How far x, y, z are beyond the sides of a box across one of its axes."""
    along = (x * fill(np.float32(turn[0, axis])) + y * fill(np.float32(turn[1, axis]))
             + z * fill(np.float32(turn[2, axis])))
    return greatest(magnitude(along) - fill(np.float32(half[axis])), fill(_NONE))


@compiled
def _twice(rows: np.ndarray) -> np.ndarray:
    more = np.empty((2 * len(rows), rows.shape[1]), np.int64)
    more[: len(rows)] = rows
    return more
