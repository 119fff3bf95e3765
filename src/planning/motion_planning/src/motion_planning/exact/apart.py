# SPDX-License-Identifier: BSD-3-Clause
"""Compiled proofs that two shapes are apart: a plane between them, or between all parts of them.

The ``forms`` of shapes: kinds (m,), BOX ... PLANE; firsts, counts (m,) of their nodes; nodes (t, 6): centre, about that
of the shape's bounds, and half sides of a box along the shape's axes; slabs (m,) and heights (s, d): the row of a
mesh's heights, -1 for other shapes, and how far it reaches along each of ``DIRECTIONS`` from that centre. A box,
sphere, cylinder, cone or plane is one node. Other shapes are a tree of boxes around their parts, those of node k in
nodes 2 k + 1 and 2 k + 2, leaves last.
"""
from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from disk_cache.compiled import compiler
from motion_planning import lanes
from motion_planning.model import kernels as model_kernels

if TYPE_CHECKING:
    Triple = tuple[float, float, float]
    Where = tuple[int, np.ndarray, np.ndarray]
    Convex = tuple[int, np.ndarray, Triple, np.ndarray]
    Forms = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]

BOX, SPHERE, CYLINDER, CONE, PLANE = range(5)
# Shapes that are nearer than this are not apart [m].
_MARGIN = 1e-6
# Steps in search of a plane between two convex shapes; pairs of nodes that are looked at; room for those that wait.
_STEPS, _LOOKS, _ROOM = 24, 200, 128



def _directions(count: int) -> np.ndarray:
    """Return (count, 3) unit vectors that are spread evenly: a spiral."""
    k = np.arange(count) + 0.5
    height, angle = 1.0 - 2.0 * k / count, math.pi * (1.0 + math.sqrt(5.0)) * k
    out = np.sqrt(1.0 - height**2)
    return np.column_stack([out * np.cos(angle), out * np.sin(angle), height])


#: Normals of planes that are tried first between a mesh and another shape.
DIRECTIONS = _directions(62)

compiled = compiler("motion_planning_exact", [
    *(Path(__file__).with_name(name) for name in ("apart.py", "kernels.py", "sixteen.py")), Path(lanes.__file__),
    Path(model_kernels.__file__)], nogil=True, error_model="numpy")


@compiled
def stack() -> np.ndarray:
    """Return what ``pair_apart`` works in."""
    return np.empty((_ROOM, 2), np.int64)


@compiled
def pair_apart(one: Forms, here: Where, other: Forms, there: Where, waiting: np.ndarray) -> bool:
    """Whether a shape of the forms ``one`` is proven to be apart from one of ``other``. here, there: the shape's index,
    and the turn (3, 3) and place (3,) of its bounds' axes and centre. False only means that there is no proof.
    """
    i, turn_a, place_a = here
    j, turn_b, place_b = there
    kinds_a, firsts_a, counts_a, nodes_a, slabs_a, heights_a = one
    kinds_b, firsts_b, counts_b, nodes_b, slabs_b, heights_b = other
    box_a, box_b = nodes_a[firsts_a[i]], nodes_b[firsts_b[j]]
    if slabs_a[i] >= 0 and _beyond_slabs(heights_a[slabs_a[i]], turn_a, place_a, (
            kinds_b[j], turn_b, _moved(turn_b, place_b, box_b), box_b[3:])):
        return True
    if slabs_b[j] >= 0 and _beyond_slabs(heights_b[slabs_b[j]], turn_b, place_b, (
            kinds_a[i], turn_a, _moved(turn_a, place_a, box_a), box_a[3:])):
        return True
    waiting[0, 0], waiting[0, 1] = 0, 0
    count, looks = 1, 0
    while count:
        count -= 1
        a, b = waiting[count, 0], waiting[count, 1]
        looks += 1
        if looks > _LOOKS:
            return False
        box_a, box_b = nodes_a[firsts_a[i] + a], nodes_b[firsts_b[j] + b]
        centre_a, centre_b = _moved(turn_a, place_a, box_a), _moved(turn_b, place_b, box_b)
        ends_a, ends_b = 2 * a + 1 >= counts_a[i], 2 * b + 1 >= counts_b[j]
        # Many steps for each box of a tree would take longer than a look at its parts.
        if _convex_apart((kinds_a[i], turn_a, centre_a, box_a[3:]), (kinds_b[j], turn_b, centre_b, box_b[3:]),
                         _STEPS if ends_a and ends_b else 0):
            continue
        if ends_a and ends_b or count + 2 > _ROOM:
            return False
        # The larger one gives way to its parts.
        if ends_b or not ends_a and _size(box_a) >= _size(box_b):
            waiting[count, 0], waiting[count + 1, 0] = 2 * a + 1, 2 * a + 2
            waiting[count, 1] = waiting[count + 1, 1] = b
        else:
            waiting[count, 0] = waiting[count + 1, 0] = a
            waiting[count, 1], waiting[count + 1, 1] = 2 * b + 1, 2 * b + 2
        count += 2
    return True


@compiled
def _beyond_slabs(heights: np.ndarray, turn: np.ndarray, place: np.ndarray, other: Convex) -> bool:
    """Whether a convex shape is beyond one of the planes around a mesh that are across ``DIRECTIONS``."""
    kind, other_turn, centre, half = other
    if kind == PLANE:
        return False
    x, y, z = centre[0] - place[0], centre[1] - place[1], centre[2] - place[2]
    u = turn[0, 0] * x + turn[1, 0] * y + turn[2, 0] * z
    v = turn[0, 1] * x + turn[1, 1] * y + turn[2, 1] * z
    w = turn[0, 2] * x + turn[1, 2] * y + turn[2, 2] * z
    # Every shape reaches this far in all directions.
    thin = 0.0 if kind == CONE else min(half[0], half[1], half[2])
    for d in range(heights.shape[0]):
        a, b, c = DIRECTIONS[d, 0], DIRECTIONS[d, 1], DIRECTIONS[d, 2]
        room = a * u + b * v + c * w - heights[d]
        if room <= thin:
            continue
        x = turn[0, 0] * a + turn[0, 1] * b + turn[0, 2] * c
        y = turn[1, 0] * a + turn[1, 1] * b + turn[1, 2] * c
        z = turn[2, 0] * a + turn[2, 1] * b + turn[2, 2] * c
        p, q, r = _farthest(kind, other_turn, half, -x, -y, -z)
        if room + p * x + q * y + r * z > _MARGIN:
            return True
    return False


@compiled
def _moved(turn: np.ndarray, place: np.ndarray, box: np.ndarray) -> Triple:
    x, y, z = box[0], box[1], box[2]
    return (place[0] + turn[0, 0] * x + turn[0, 1] * y + turn[0, 2] * z,
            place[1] + turn[1, 0] * x + turn[1, 1] * y + turn[1, 2] * z,
            place[2] + turn[2, 0] * x + turn[2, 1] * y + turn[2, 2] * z)


@compiled
def _size(box: np.ndarray) -> float:
    return max(box[3], box[4], box[5])


@compiled
def _convex_apart(one: Convex, other: Convex, steps: int) -> bool:
    """Whether a plane between two convex shapes (kind, turn, centre, half sides) is found, in some ``steps`` beyond
    that of their boxes.
    """
    kind_a, turn_a, centre_a, half_a = one
    kind_b, turn_b, centre_b, half_b = other
    if kind_b == PLANE:
        return _apart_from_plane(kind_a, turn_a, centre_a, half_a, turn_b, centre_b)
    if kind_a == PLANE:
        return _apart_from_plane(kind_b, turn_b, centre_b, half_b, turn_a, centre_a)
    if not boxes_meet(turn_a, centre_a, half_a, turn_b, centre_b, half_b):
        return True
    if kind_a == BOX and kind_b == BOX:
        return False
    # Towards the point of all differences of points of the two that is nearest to 0 (Gilbert 1966): as soon as all of
    # them lie beyond a plane, it is one between the shapes.
    x, y, z = centre_a[0] - centre_b[0], centre_a[1] - centre_b[1], centre_a[2] - centre_b[2]
    for _ in range(steps):
        square = x * x + y * y + z * z
        if square < 1e-12:
            return False
        au, av, aw = _farthest(kind_a, turn_a, half_a, -x, -y, -z)
        bu, bv, bw = _farthest(kind_b, turn_b, half_b, x, y, z)
        u = centre_a[0] + au - centre_b[0] - bu
        v = centre_a[1] + av - centre_b[1] - bv
        w = centre_a[2] + aw - centre_b[2] - bw
        if u * x + v * y + w * z > _MARGIN * math.sqrt(square):
            return True
        u, v, w = u - x, v - y, w - z
        length = u * u + v * v + w * w
        step = -(x * u + y * v + z * w)
        if step <= 1e-9 * length:
            return False
        step = min(1.0, step / length)
        x, y, z = x + step * u, y + step * v, z + step * w
    return False


@compiled
def _apart_from_plane(kind: int, turn: np.ndarray, centre: Triple, half: np.ndarray, plane_turn: np.ndarray,
                      plane: Triple) -> bool:
    x, y, z = plane_turn[0, 2], plane_turn[1, 2], plane_turn[2, 2]
    height = x * (centre[0] - plane[0]) + y * (centre[1] - plane[1]) + z * (centre[2] - plane[2])
    u, v, w = _farthest(kind, turn, half, x, y, z)
    above = height + x * u + y * v + z * w
    u, v, w = _farthest(kind, turn, half, -x, -y, -z)
    return height + x * u + y * v + z * w > _MARGIN or above < -_MARGIN


@compiled
def _farthest(kind: int, turn: np.ndarray, half: np.ndarray, x: float, y: float, z: float) -> Triple:
    """The point of a shape, about its centre, that is farthest in direction x, y, z."""
    if kind == SPHERE:
        share = half[0] / math.sqrt(x * x + y * y + z * z)
        return share * x, share * y, share * z
    u = turn[0, 0] * x + turn[1, 0] * y + turn[2, 0] * z
    v = turn[0, 1] * x + turn[1, 1] * y + turn[2, 1] * z
    w = turn[0, 2] * x + turn[1, 2] * y + turn[2, 2] * z
    up = math.copysign(half[2], w)
    if kind == BOX:
        a, b = math.copysign(half[0], u), math.copysign(half[1], v)
    else:
        out = math.sqrt(u * u + v * v)
        share = half[0] / out if out > 0.0 else 0.0
        a, b = share * u, share * v
        if kind == CONE:
            if 2.0 * half[2] * w >= half[0] * out:
                a, b, up = 0.0, 0.0, half[2]
            else:
                up = -half[2]
    return (turn[0, 0] * a + turn[0, 1] * b + turn[0, 2] * up, turn[1, 0] * a + turn[1, 1] * b + turn[1, 2] * up,
            turn[2, 0] * a + turn[2, 1] * b + turn[2, 2] * up)


@compiled
def boxes_meet(turn_a: np.ndarray, centre_a: np.ndarray | Triple, half_a: np.ndarray, turn_b: np.ndarray,
               centre_b: np.ndarray | Triple, half_b: np.ndarray) -> bool:
    """Whether two boxes overlap or are nearer than a micrometre: no one of 15 axes separates them (Gottschalk 1996).

    All in scalars: an array made here would take longer than the rest.
    """
    margin = 1e-6
    x, y, z = centre_b[0] - centre_a[0], centre_b[1] - centre_a[1], centre_b[2] - centre_a[2]
    t0, r00, r01, r02 = _along(turn_a, 0, x, y, z, turn_b)
    s00, s01, s02 = abs(r00) + 1e-9, abs(r01) + 1e-9, abs(r02) + 1e-9
    a0, a1, a2, b0, b1, b2 = half_a[0], half_a[1], half_a[2], half_b[0], half_b[1], half_b[2]
    if abs(t0) > a0 + b0 * s00 + b1 * s01 + b2 * s02 + margin:
        return False
    t1, r10, r11, r12 = _along(turn_a, 1, x, y, z, turn_b)
    s10, s11, s12 = abs(r10) + 1e-9, abs(r11) + 1e-9, abs(r12) + 1e-9
    if abs(t1) > a1 + b0 * s10 + b1 * s11 + b2 * s12 + margin:
        return False
    t2, r20, r21, r22 = _along(turn_a, 2, x, y, z, turn_b)
    s20, s21, s22 = abs(r20) + 1e-9, abs(r21) + 1e-9, abs(r22) + 1e-9
    if abs(t2) > a2 + b0 * s20 + b1 * s21 + b2 * s22 + margin:
        return False
    if (abs(t0 * r00 + t1 * r10 + t2 * r20) > b0 + a0 * s00 + a1 * s10 + a2 * s20 + margin
            or abs(t0 * r01 + t1 * r11 + t2 * r21) > b1 + a0 * s01 + a1 * s11 + a2 * s21 + margin
            or abs(t0 * r02 + t1 * r12 + t2 * r22) > b2 + a0 * s02 + a1 * s12 + a2 * s22 + margin):
        return False
    # The cross products of an axis of each.
    return not (abs(t2 * r10 - t1 * r20) > a1 * s20 + a2 * s10 + b1 * s02 + b2 * s01 + margin
                or abs(t2 * r11 - t1 * r21) > a1 * s21 + a2 * s11 + b2 * s00 + b0 * s02 + margin
                or abs(t2 * r12 - t1 * r22) > a1 * s22 + a2 * s12 + b0 * s01 + b1 * s00 + margin
                or abs(t0 * r20 - t2 * r00) > a2 * s00 + a0 * s20 + b1 * s12 + b2 * s11 + margin
                or abs(t0 * r21 - t2 * r01) > a2 * s01 + a0 * s21 + b2 * s10 + b0 * s12 + margin
                or abs(t0 * r22 - t2 * r02) > a2 * s02 + a0 * s22 + b0 * s11 + b1 * s10 + margin
                or abs(t1 * r00 - t0 * r10) > a0 * s10 + a1 * s00 + b1 * s22 + b2 * s21 + margin
                or abs(t1 * r01 - t0 * r11) > a0 * s11 + a1 * s01 + b2 * s20 + b0 * s22 + margin
                or abs(t1 * r02 - t0 * r12) > a0 * s12 + a1 * s02 + b0 * s21 + b1 * s20 + margin)


@compiled
def _along(turn_a: np.ndarray, axis: int, x: float, y: float, z: float,
           turn_b: np.ndarray) -> tuple[float, float, float, float]:
    """The components of (x, y, z) and of the three axes of b along an axis of a."""
    u, v, w = turn_a[0, axis], turn_a[1, axis], turn_a[2, axis]
    return (u * x + v * y + w * z, u * turn_b[0, 0] + v * turn_b[1, 0] + w * turn_b[2, 0],
            u * turn_b[0, 1] + v * turn_b[1, 1] + w * turn_b[2, 1],
            u * turn_b[0, 2] + v * turn_b[1, 2] + w * turn_b[2, 2])
