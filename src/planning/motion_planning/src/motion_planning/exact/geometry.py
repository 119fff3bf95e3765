# SPDX-License-Identifier: BSD-3-Clause
"""FCL geometry of shapes, their bounding boxes, and planes without thickness, which FCL does not have."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple

import fcl
import numpy as np

from motion_planning.exact import apart
from motion_planning.exact.octree import codes_of, occupied_tree
from motion_planning.shapes import Cone, Octree, TriangleMesh
from urdf_model import Box, Cylinder, Plane, Sphere

if TYPE_CHECKING:
    from motion_planning.shapes import Geometry

# The greatest number of triangles or cubes in a leaf of a shape's tree of boxes, and the most levels of such a tree.
_IN_A_LEAF, _MAX_LEVELS = 4, 14
#: Half the side of a plane's box [m]: larger than any scene.
_ENDLESS = 1e6

# A triangle is flat where twice its area is less than this part of its longest side's square.
_SLIVER = 1e-9
_MIN_SIDE_M = 1e-9


class ShapeBounds(NamedTuple):
    """A box around a shape, along the shape's axes, and a ball about the same centre [m], in the shape's frame."""

    centre: np.ndarray
    half: np.ndarray
    radius: float


class ShapeForm(NamedTuple):
    """nodes (n, 6) of a shape that is made of parts and, of a mesh, heights (d,): see ``apart``."""

    nodes: np.ndarray
    heights: np.ndarray | None


def simple_of(shape: Geometry) -> tuple[int, tuple[float, float, float], float] | None:
    """Return (kind, see ``apart``, half sides of the box around a shape, radius of the ball) of a shape about its
    origin, None for those that are made of parts."""
    if isinstance(shape, Box):
        x, y, z = (0.5 * side for side in shape.size)
        return apart.BOX, (x, y, z), math.hypot(x, y, z)
    if isinstance(shape, Cylinder | Cone):
        kind = apart.CYLINDER if isinstance(shape, Cylinder) else apart.CONE
        return kind, (shape.radius, shape.radius, 0.5 * shape.length), math.hypot(shape.radius, 0.5 * shape.length)
    if isinstance(shape, Sphere):
        return apart.SPHERE, (shape.radius, shape.radius, shape.radius), shape.radius
    if isinstance(shape, Plane):
        return apart.PLANE, (_ENDLESS, _ENDLESS, 0.0), 2.0 * _ENDLESS
    return None


def bounds_of(shape: Geometry) -> ShapeBounds:
    """Return the :class:`ShapeBounds` of a shape. Raises TypeError for other objects."""
    simple = simple_of(shape)
    if simple is not None:
        return ShapeBounds(np.zeros(3), np.array(simple[1]), simple[2])
    if isinstance(shape, TriangleMesh):
        low, high = shape.corners.min(axis=0), shape.corners.max(axis=0)
        centre = 0.5 * (low + high)
        return ShapeBounds(centre, 0.5 * (high - low), float(np.linalg.norm(shape.corners - centre, axis=1).max()))
    if isinstance(shape, Octree):
        side = 0.5 * shape.boxes[:, 3:]
        low, high = (shape.boxes[:, :3] - side).min(axis=0), (shape.boxes[:, :3] + side).max(axis=0)
        half = 0.5 * (high - low)
        return ShapeBounds(0.5 * (low + high), half, float(np.linalg.norm(half)))
    raise TypeError("%r is not a shape that can collide" % (shape,))


def form_of(shape: Geometry, bounds: ShapeBounds) -> ShapeForm:
    """Return the ShapeForm of a mesh or octree with these ShapeBounds. Raises TypeError for other objects."""
    if isinstance(shape, TriangleMesh):
        corners = shape.vertices[shape.triangles]
        low, high, order = corners.min(axis=1), corners.max(axis=1), np.arange(len(corners))[None]
        heights = np.array([(shape.corners @ way).max() - way @ bounds.centre for way in apart.DIRECTIONS])
    elif isinstance(shape, Octree):
        # Cubes of a cloud change all the time, and planes around all of them say little.
        side, heights = 0.5 * shape.boxes[:, 3:], None
        low, high = shape.boxes[:, :3] - side, shape.boxes[:, :3] + side
        order = np.argsort(codes_of(shape), kind="stable")[None]
    else:
        raise TypeError("%r is not made of parts" % (shape,))
    levels = min(_MAX_LEVELS, max(0, math.ceil(math.log2(len(low) / _IN_A_LEAF))))
    middle = low + high
    # Each level cuts all groups in half, cubes along Morton's curve and triangles along their group's longest side;
    # where halves are not equal, one is in both.
    for _ in range(levels):
        if isinstance(shape, TriangleMesh):
            some = middle[order]
            axis = np.ptp(some, axis=1).argmax(axis=1)
            along = np.take_along_axis(some, axis[:, None, None], axis=2)[:, :, 0]
            order = np.take_along_axis(order, np.argsort(along, axis=1, kind="stable"), axis=1)
        half = (order.shape[1] + 1) // 2
        order = np.stack([order[:, :half], order[:, -half:]], axis=1).reshape(-1, half)
    low, high = low[order].min(axis=1), high[order].max(axis=1)
    found = []
    while True:
        found.append(np.concatenate([0.5 * (low + high) - bounds.centre, 0.5 * (high - low)], axis=1))
        if len(low) == 1:
            return ShapeForm(np.concatenate(found[::-1]), heights)
        low, high = np.minimum(low[::2], low[1::2]), np.maximum(high[::2], high[1::2])


def fcl_geometry(shape: Geometry) -> Any:
    """Return the FCL geometry of a shape; None for a plane; use :func:`plane_overlap` for that."""
    if isinstance(shape, Plane):
        return None
    if isinstance(shape, Box):
        return fcl.Box(*shape.size)
    if isinstance(shape, Sphere):
        return fcl.Sphere(shape.radius)
    if isinstance(shape, Cylinder):
        return fcl.Cylinder(shape.radius, shape.length)
    if isinstance(shape, Cone):
        return fcl.Cone(shape.radius, shape.length)
    if isinstance(shape, TriangleMesh):
        vertices, triangles = _with_areas(shape)
        model = fcl.BVHModel()
        model.beginModel(len(triangles), len(vertices))
        model.addSubModel(vertices, triangles)
        model.endModel()
        return model
    return fcl.OcTree(shape.resolution, occupied_tree(shape))


def _with_areas(mesh: TriangleMesh) -> tuple[np.ndarray, np.ndarray]:
    """(vertices, triangles) of a mesh with slivers in place of triangles that have no area: FCL 0.7 misses some spheres
    that touch those, and sees others that do not."""
    corners = mesh.vertices[mesh.triangles]
    sides = np.roll(corners, -1, axis=1) - corners  # from each corner to the next
    lengths = np.linalg.norm(sides, axis=2)
    longest = lengths.max(axis=1)
    flat = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1) <= _SLIVER * longest**2
    if not flat.any():
        return mesh.vertices, mesh.triangles
    at = lengths[flat].argmax(axis=1)
    each = np.arange(len(at))
    begin, side = corners[flat][each, at], sides[flat][each, at]
    # Across the side: its cross product with the axis that it leans to least.
    across = np.cross(side, np.eye(3)[np.abs(side).argmin(axis=1)])
    size = np.linalg.norm(across, axis=1, keepdims=True)
    across = np.where(size > 0.0, across / np.maximum(size, 1e-300), (0.0, 0.0, 1.0))
    along = np.where(longest[flat, None] > 0.0, side, (_MIN_SIDE_M, 0.0, 0.0))
    width = np.maximum(10.0 * _SLIVER * longest[flat, None], _MIN_SIDE_M)
    slivers = np.stack([begin, begin + along, begin + 0.5 * along + width * across], axis=1)
    count = len(mesh.vertices)
    triangles = mesh.triangles.copy()
    triangles[flat] = count + np.arange(3 * len(at)).reshape(-1, 3)
    return np.vstack([mesh.vertices, slivers.reshape(-1, 3)]), triangles


def grown(shape: Geometry, padding: float, scale: float) -> Geometry:
    """Return a shape scaled about its middle and then grown by ``padding`` [m] to every side."""
    if padding == 0.0 and scale == 1.0:
        return shape
    if isinstance(shape, Box):
        x, y, z = (side * scale + 2.0 * padding for side in shape.size)
        return Box((x, y, z))
    if isinstance(shape, Sphere):
        return Sphere(shape.radius * scale + padding)
    if isinstance(shape, Cylinder | Cone):
        return type(shape)(shape.radius * scale + padding, shape.length * scale + 2.0 * padding)
    if isinstance(shape, TriangleMesh):
        middle = shape.vertices.mean(axis=0)
        out = (shape.vertices - middle) * scale
        lengths = np.linalg.norm(out, axis=1, keepdims=True)
        return TriangleMesh(middle + out * (1.0 + padding / np.maximum(lengths, 1e-9)), shape.triangles)
    return shape


def plane_overlap(plane_pose: np.ndarray, shape: Geometry, pose: np.ndarray) -> float:
    """Return the overlap of a shape with a plane [m]; below 0, its distance from the plane.

    ``plane_pose`` (4, 4): the plane is the x-y plane of this frame, infinite and without thickness; ``pose`` (4, 4):
    the shape's, in the same frame.
    """
    normal = plane_pose[:3, 2]
    height = float(normal @ (pose[:3, 3] - plane_pose[:3, 3]))
    low, high = _extent(shape, pose[:3, :3].T @ normal)
    return min(height + high, -(height + low))


def _extent(shape: Geometry, direction: np.ndarray) -> tuple[float, float]:
    """(lowest, highest) of a shape along the unit vector ``direction``, in the shape's frame, about its origin."""
    if isinstance(shape, Sphere):
        return -shape.radius, shape.radius
    if isinstance(shape, Cylinder | Cone):
        round_part = shape.radius * float(np.sqrt(max(0.0, 1.0 - direction[2] ** 2)))
        up = 0.5 * shape.length * direction[2]
        if isinstance(shape, Cylinder):
            return -round_part - abs(up), round_part + abs(up)
        return min(up, -up - round_part), max(up, -up + round_part)
    if isinstance(shape, TriangleMesh):
        along = shape.corners @ direction
    elif isinstance(shape, Octree):
        reach = 0.5 * shape.boxes[:, 3] * np.abs(direction).sum()
        middle = shape.boxes[:, :3] @ direction
        along = np.concatenate([middle - reach, middle + reach])
    else:
        along = np.array((-1.0, 1.0)) * (bounds_of(shape).half @ np.abs(direction))
    return float(along.min()), float(along.max())
