# SPDX-License-Identifier: BSD-3-Clause
"""Regions of points and rotations: tests whether one is inside, and random samples."""
from __future__ import annotations

import math
import weakref
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from motion_planning.shapes import Cone, TriangleMesh
from urdf_model import Box, Cylinder, Sphere
from urdf_model.transforms import axis_rotation, rpy_matrix

if TYPE_CHECKING:
    from numpy.random import Generator as Random

    Volume = Box | Sphere | Cylinder | Cone | TriangleMesh

# Tolerance of comparisons with an edge [m], for rounding errors.
_EDGE = 1e-9
# The planes of meshes, made once for each.
_planes = weakref.WeakKeyDictionary()


def has_inside(shape: object) -> bool:
    """Whether a point can be in a shape."""
    return isinstance(shape, Box | Sphere | Cylinder | Cone | TriangleMesh)


def holds(shape: Volume, point: np.ndarray) -> bool:
    """Whether ``point`` (3 or more,), in the shape's frame, lies in it or on its edge."""
    x, y, z = map(float, point[:3])
    if isinstance(shape, Sphere):
        return math.sqrt(x * x + y * y + z * z) <= shape.radius + _EDGE
    if isinstance(shape, Box):
        return all(abs(value) <= 0.5 * side + _EDGE for value, side in zip((x, y, z), shape.size, strict=True))
    if isinstance(shape, TriangleMesh):
        normals, offsets, _ = planes_of(shape, point)
        return bool((normals @ (x, y, z) <= offsets + _EDGE).all())
    radius = shape.radius
    if isinstance(shape, Cone):
        radius *= max(0.0, 0.5 - z / shape.length)
    return abs(z) <= 0.5 * shape.length + _EDGE and math.hypot(x, y) <= radius + _EDGE


def planes_of(shape: Cone | TriangleMesh, point: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (normals (n, 3) outwards, offsets (n,) along them, depths (n,) of the shape's middle behind them) of the
    planes that bound a mesh, or a cone next to ``point`` (3,)."""
    if isinstance(shape, TriangleMesh):
        if shape not in _planes:
            _planes[shape] = _planes_of_mesh(shape)
        return _planes[shape]
    slant = math.hypot(shape.length, shape.radius)
    away = np.array((*point[:2], 0.0)) / max(1e-12, math.hypot(*point[:2]))
    side = (shape.length * away + np.array((0.0, 0.0, shape.radius))) / slant
    offsets = np.array((0.5 * shape.length, 0.5 * shape.radius * shape.length / slant))
    return np.array(((0.0, 0.0, -1.0), side)), offsets, offsets


def _planes_of_mesh(mesh: TriangleMesh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    corners, middle = mesh.vertices[mesh.triangles], mesh.vertices.mean(axis=0)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    outwards = np.einsum("na,na->n", normals, corners[:, 0] - middle)
    normals *= np.sign(outwards)[:, None] / np.maximum(np.linalg.norm(normals, axis=1), 1e-30)[:, None]
    offsets = np.einsum("na,na->n", normals, corners[:, 0])
    return normals, offsets, offsets - normals @ middle


def point_in(shape: Volume, generator: Random) -> np.ndarray:
    """Return a random point (3,) of a shape, in its frame, uniformly distributed."""
    if isinstance(shape, Sphere):
        direction = generator.normal(size=3)
        return direction * (shape.radius * generator.random() ** (1.0 / 3.0) / max(1e-12, np.linalg.norm(direction)))
    if isinstance(shape, Box):
        return generator.uniform(-0.5, 0.5, 3) * shape.size
    if isinstance(shape, Cylinder):
        turn, away = generator.uniform(0.0, 2.0 * math.pi), shape.radius * math.sqrt(generator.random())
        return np.array((away * math.cos(turn), away * math.sin(turn), generator.uniform(-0.5, 0.5) * shape.length))
    if isinstance(shape, Cone):
        low, high = np.array((-shape.radius, -shape.radius, -0.5 * shape.length)), np.array(
            (shape.radius, shape.radius, 0.5 * shape.length))
    else:
        low, high = shape.vertices.min(axis=0), shape.vertices.max(axis=0)
    for _ in range(200):
        point = generator.uniform(low, high)
        if holds(shape, point):
            return point
    return 0.5 * (low + high)


def size_of(shape: Volume) -> float:
    """Return the approximate extent of a shape [m]."""
    if isinstance(shape, TriangleMesh):
        return float(np.ptp(shape.vertices, axis=0).max())
    return max(shape.size) if isinstance(shape, Box) else max(shape.radius, getattr(shape, "length", 0.0))


def middle_of(shape: Volume) -> np.ndarray:
    """Return the point (3,) of a shape to try first, in its frame."""
    return shape.vertices.mean(axis=0) if isinstance(shape, TriangleMesh) else np.zeros(3)


def turn_within(tolerances: Sequence[float], as_vector: bool, generator: Random) -> np.ndarray:
    """Return a random rotation (3, 3) within ``tolerances`` (3,) [rad], as in OrientationTarget."""
    angles = generator.uniform(-1.0, 1.0, 3) * np.minimum(tolerances, math.pi)
    if as_vector:
        length = float(np.linalg.norm(angles))
        return np.eye(3) if length < 1e-12 else axis_rotation(angles / length, length)
    # About x, then the new y, then the new z.
    return rpy_matrix(angles[0], 0, 0) @ rpy_matrix(0, angles[1], 0) @ rpy_matrix(0, 0, angles[2])


def rotation_vector(turn: np.ndarray) -> np.ndarray:
    """Return axis times angle (3,) [rad] of a rotation (3, 3)."""
    sine = 0.5 * np.array((turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]))
    length, cosine = float(np.linalg.norm(sine)), 0.5 * (np.trace(turn) - 1.0)
    angle = math.atan2(length, cosine)
    if length > 1e-7:
        return sine * (angle / length)
    if cosine > 0.0:
        return sine
    # Half a turn: the axis is the column of (turn + 1) / 2 that is longest.
    column = (0.5 * (turn + np.eye(3)))[:, int(np.argmax(np.diag(turn)))]
    return column / np.linalg.norm(column) * angle
