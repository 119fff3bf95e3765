# SPDX-License-Identifier: BSD-3-Clause
"""Fixed bodies as flat arrays for ``kernel``: objects, and trees of boxes around them."""
from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from motion_planning.shapes import Cone, Octree, TriangleMesh
from motion_planning.spheres import kernel
from motion_planning.spheres.compiled import compiled
from motion_planning.spheres.sphere_model import Boxes, Patience, box_around, boxes_of
from urdf_model import Box, Cylinder, Plane, Sphere

if TYPE_CHECKING:
    from motion_planning.shapes import Geometry
    from motion_planning.spheres.kernel import World

    Forest = tuple[World, list[tuple[int, int]]]

# Corners of infinite shapes are this far away [m].
_FAR = 1e6
# A cone becomes the pyramid around it with this many sides.
_CONE_SIDES = 24
# Margin of a tree's boxes around their content [m], for single floats.
_ROUNDING = 1e-5
# Number of boxes that are taken between two looks at the clock.
_AT_ONCE = 1000
_ENDLESS = Patience()


class Solids(NamedTuple):
    """n objects. kinds (n,), numbers (n, 16): see ``kernel``; low, high (n, 3): corners of boxes around them."""

    kinds: np.ndarray
    numbers: np.ndarray
    low: np.ndarray
    high: np.ndarray


class BoxTree(NamedTuple):
    """Objects and the boxes around them, counted from 0."""

    links: np.ndarray
    nodes: np.ndarray
    kinds: np.ndarray
    objects: np.ndarray


def solids_of(parts: Sequence[tuple[Geometry | Boxes, np.ndarray]], pad: float = 0.0, patience: Patience = _ENDLESS,
              remark: Callable[[int, str], object] = lambda number, how: None) -> Solids:
    """Return the Solids of ``parts``, [(geometry, pose (4, 4) in the planning frame)], ``pad`` [m] larger all round.

    remark(number, how): told how a part is replaced by something coarser than usual.
    """
    boxes, cylinders, found = [], [], []
    for number, (geometry, pose) in enumerate(parts):
        if number % _AT_ONCE == 0 or not isinstance(geometry, Box | Cylinder):
            patience.check()
        if isinstance(geometry, Box):
            boxes.append((geometry.size, pose))
        elif isinstance(geometry, Cylinder):
            cylinders.append((geometry.radius, geometry.length, pose))
        else:
            found.append(_solids(_of_boxes(geometry, patience, partial(remark, number)), pose, pad))
    if boxes:
        sizes, poses = (np.array(column, dtype=float) for column in zip(*boxes, strict=True))
        found.append(_boxes(poses[:, :3, 3], poses[:, :3, :3].transpose(0, 2, 1), 0.5 * sizes + pad))
    if cylinders:
        radii, lengths, poses = (np.array(column, dtype=float) for column in zip(*cylinders, strict=True))
        found.append(_cylinders(poses[:, :3, 3], poses[:, :3, :3].transpose(0, 2, 1), radii + pad, 0.5 * lengths + pad))
    return joined(found)


def _boxes(centres: np.ndarray, rotations: np.ndarray, half: np.ndarray) -> Solids:
    """The Solids of boxes: centres, half sides (n, 3), rotations (n, 3, 3) from the planning frame."""
    found = _room(len(centres))
    _fill_boxes(*map(np.ascontiguousarray, (centres, rotations, half)), *found)
    return found


def _cylinders(centres: np.ndarray, rotations: np.ndarray, radii: np.ndarray, halves: np.ndarray) -> Solids:
    """The Solids of cylinders: centres (n, 3), rotations (n, 3, 3) from the planning frame, radii and half lengths."""
    found = _room(len(centres))
    _fill_cylinders(*map(np.ascontiguousarray, (centres, rotations, np.column_stack([radii, halves]))), *found)
    return found


def _room(count: int) -> Solids:
    return Solids(np.empty(count, np.int32), np.empty((count, kernel.OBJECT), np.float32), *np.empty((2, count, 3)))


@compiled
def _fill_boxes(centres: np.ndarray, rotations: np.ndarray, half: np.ndarray, kinds: np.ndarray, numbers: np.ndarray,
                low: np.ndarray, high: np.ndarray) -> None:
    for n in range(len(kinds)):
        straight = 0
        for b in range(3):
            reach = 0.0
            for a in range(3):
                reach += half[n, a] * abs(rotations[n, a, b])
                straight += abs(abs(rotations[n, a, b]) - 1.0) < 1e-9
            low[n, b], high[n, b] = centres[n, b] - reach, centres[n, b] + reach
        kinds[n] = kernel.AXIS_BOX if straight == 3 else kernel.BOX
        _fill_place(centres[n], rotations[n], numbers[n])
        for b in range(3):
            numbers[n, 12 + b] = 0.5 * (high[n, b] - low[n, b]) if straight == 3 else half[n, b]


@compiled
def _fill_cylinders(centres: np.ndarray, rotations: np.ndarray, sizes: np.ndarray, kinds: np.ndarray,
                    numbers: np.ndarray, low: np.ndarray, high: np.ndarray) -> None:
    for n in range(len(kinds)):
        radius, half = sizes[n, 0], sizes[n, 1]
        for b in range(3):
            along = rotations[n, 2, b]
            reach = half * abs(along) + radius * math.sqrt(max(0.0, 1.0 - along * along))
            low[n, b], high[n, b] = centres[n, b] - reach, centres[n, b] + reach
        upright = abs(abs(rotations[n, 2, 2]) - 1.0) < 1e-9
        kinds[n] = kernel.UPRIGHT_CYLINDER if upright else kernel.CYLINDER
        _fill_place(centres[n], rotations[n], numbers[n])
        numbers[n, 12], numbers[n, 14] = radius, half


@compiled
def _fill_place(centre: np.ndarray, rotation: np.ndarray, numbers: np.ndarray) -> None:
    numbers[:] = 0.0
    for a in range(3):
        numbers[a] = centre[a]
        for b in range(3):
            numbers[3 + 3 * a + b] = rotation[a, b]


def _of_boxes(geometry: Geometry | Boxes, patience: Patience, remark: Callable[[str], object]) -> Geometry | Boxes:
    """Meshes and cones as Boxes, other geometry unchanged."""
    mesh = pyramid(geometry) if isinstance(geometry, Cone) else geometry
    if not isinstance(mesh, TriangleMesh):
        return geometry
    if patience.late():
        remark("its bounding box, because there was no time for more")
        return box_around(mesh)
    boxes = boxes_of(mesh)
    if isinstance(boxes, Boxes) and boxes.coarse is not None:
        remark("boxes of %.3g m, because its %d triangles are too many or too large for finer ones"
               % (boxes.coarse, len(mesh.triangles)))
    return boxes


def joined(found: Sequence[Solids]) -> Solids:
    """Return one Solids of many."""
    if not found:
        return Solids(np.empty(0, np.int32), np.empty((0, kernel.OBJECT), np.float32), *np.empty((2, 0, 3)))
    return Solids(*(np.concatenate(arrays) for arrays in zip(*found, strict=True)))


def _solids(geometry: Geometry | Boxes, pose: np.ndarray, pad: float) -> Solids:
    rotation, centre = pose[:3, :3].T, pose[:3, 3]
    if isinstance(geometry, Plane):
        return _one(kernel.PLANE, centre, rotation, (0.0, 0.0, pad), np.full(3, _FAR))
    if isinstance(geometry, Sphere):
        radius = geometry.radius + pad
        return _one(kernel.SPHERE, centre, rotation, (radius, 0.0, 0.0), np.full(3, radius))
    corners = _corners(geometry)
    middle, half = 0.5 * (corners[:, 0] + corners[:, 1]), 0.5 * (corners[:, 1] - corners[:, 0]) + pad
    return _boxes(middle @ rotation + centre, np.broadcast_to(rotation, (len(corners), 3, 3)), half)


def _one(kind: int, centre: np.ndarray, rotation: np.ndarray, sizes: Sequence[float], reach: np.ndarray) -> Solids:
    return Solids(np.array([kind], np.int32), np.array([[*centre, *rotation.ravel(), *sizes, 0.0]], np.float32),
                  (centre - reach)[None], (centre + reach)[None])


def _corners(geometry: Geometry | Boxes) -> np.ndarray:
    """(n, 2, 3) of shapes made of boxes."""
    if isinstance(geometry, Boxes):
        return geometry.corners
    if isinstance(geometry, Octree):
        half = 0.5 * geometry.boxes[:, 3:]
        return np.stack([geometry.boxes[:, :3] - half, geometry.boxes[:, :3] + half], axis=1)
    raise TypeError("%r is not a shape that can collide" % (geometry,))


def pyramid(cone: Cone) -> TriangleMesh:
    """Return the TriangleMesh of a pyramid around a Cone."""
    k = np.arange(_CONE_SIDES)
    angle, around = 2.0 * np.pi * k / _CONE_SIDES, cone.radius / math.cos(math.pi / _CONE_SIDES)
    half = 0.5 * cone.length
    rim = np.column_stack([around * np.cos(angle), around * np.sin(angle), np.full(_CONE_SIDES, -half)])
    after = (k + 1) % _CONE_SIDES
    tip, base = np.full_like(k, _CONE_SIDES), np.full_like(k, _CONE_SIDES + 1)
    return TriangleMesh(np.concatenate([rim, [[0.0, 0.0, half], [0.0, 0.0, -half]]]),
                        np.concatenate([np.column_stack([k, after, tip]), np.column_stack([after, k, base])]))


def tree_of(solids: Solids) -> BoxTree:
    """Return the BoxTree over Solids: halves of the order in which a space-filling curve meets them, one object a
    leaf."""
    count = len(solids.kinds)
    order = _along_curve(solids.low, solids.high)
    links = np.empty((max(0, 2 * count - 1), 2), np.int32)
    nodes = np.empty((len(links), 6), np.float32)
    _fill_tree(np.concatenate([solids.low[order] - _ROUNDING, solids.high[order] + _ROUNDING], axis=1).astype(
        np.float32), links, nodes)
    return BoxTree(links, nodes, solids.kinds[order], solids.numbers[order])


@compiled
def _fill_tree(boxes: np.ndarray, links: np.ndarray, nodes: np.ndarray) -> None:
    """Write the tree over ``boxes`` (n, 6) float32: what is below a node has the numbers that follow."""
    waiting = np.empty((64, 3), np.int64)  # (first, last + 1 object, number of the node)
    waiting[0, 0], waiting[0, 1], waiting[0, 2] = 0, boxes.shape[0], 0
    count = min(1, boxes.shape[0])
    while count:
        count -= 1
        first, last, number = waiting[count, 0], waiting[count, 1], waiting[count, 2]
        size = last - first
        links[number, 0], links[number, 1] = number + 2 * size - 1, first if size == 1 else -1
        if size == 1:
            nodes[number] = boxes[first]
            continue
        middle = first + size // 2
        waiting[count, 0], waiting[count, 1], waiting[count, 2] = middle, last, number + 2 * (size // 2)
        waiting[count + 1, 0], waiting[count + 1, 1], waiting[count + 1, 2] = first, middle, number + 1
        count += 2
    for number in range(links.shape[0] - 1, -1, -1):  # what is below comes first
        if links[number, 1] < 0:
            other = links[number + 1, 0]
            for axis in range(3):
                nodes[number, axis] = min(nodes[number + 1, axis], nodes[other, axis])
                nodes[number, 3 + axis] = max(nodes[number + 1, 3 + axis], nodes[other, 3 + axis])


def _along_curve(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """The order in which Morton's curve meets the middles of boxes with these corners (n, 3)."""
    return np.argsort(_codes(low, high), kind="stable")


@compiled
def _codes(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Where each box's middle is along Morton's curve through all of them."""
    count = len(low)
    code = np.zeros(count, np.int64)
    for axis in range(3):
        least, most = _FAR, -_FAR
        for n in range(count):
            middle = 0.5 * (low[n, axis] + high[n, axis])
            least, most = min(least, middle), max(most, middle)
        scale = 1023.0 / max(most - least, 1e-9)
        for n in range(count):
            cell = int((0.5 * (low[n, axis] + high[n, axis]) - least) * scale)
            for bit in range(10):
                code[n] |= (cell >> bit & 1) << (3 * bit + axis)
    return code


def forest(trees: Sequence[BoxTree], before: Forest | None = None) -> Forest:
    """Return (world, [(first node, last + 1)]): many Trees as one table, see ``kernel``.

    before: what this function returned for Trees that come before them.
    """
    world, places = before or (_flat([_EMPTY]), [])
    nodes_before, objects_before, places, moved = len(world[0]) // 2, len(world[2]), list(places), []
    for tree in trees:
        links = tree.links.copy()
        links[:, 0] += nodes_before
        links[links[:, 1] >= 0, 1] += objects_before
        moved.append(tree._replace(links=links))
        places.append((nodes_before, nodes_before + len(links)))
        nodes_before, objects_before = nodes_before + len(links), objects_before + len(tree.kinds)
    links, nodes, kinds, objects = map(np.concatenate, zip(world, _flat([_EMPTY, *moved]), strict=True))
    return (links, nodes, kinds, objects), places


def _flat(trees: Sequence[BoxTree]) -> World:
    links, nodes, kinds, objects = (np.concatenate(arrays) for arrays in zip(*trees, strict=True))
    return links.ravel(), nodes.ravel(), kinds, objects.ravel()


_EMPTY = tree_of(joined([]))
