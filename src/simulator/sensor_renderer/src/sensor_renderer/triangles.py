# SPDX-License-Identifier: BSD-3-Clause
"""Shapes as bare triangles with normals, ready for a graphics pipeline. ROS-free.

Triangles are float32 arrays (3 m, 6): three rows for each triangle, a row is x y z [m] and the unit normal there.
"""
from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from urdf_model import Box, Cylinder, Sphere
from world_picture.reduction import corner_normals

#: Corners of a circle, the finest first.
CIRCLES = (128, 64, 32)


def of_primitive(geometry: Box | Cylinder | Sphere, corners: int = CIRCLES[-1]) -> np.ndarray:
    """Triangles of a ``urdf_model`` Box, Cylinder or Sphere about its own origin, with so many ``corners`` of a circle;
    ``TypeError`` for anything else."""
    if isinstance(geometry, Box):
        return _box(np.asarray(geometry.size) / 2.0)
    if isinstance(geometry, Cylinder):
        half, radius = geometry.length / 2.0, geometry.radius + circle_error(geometry.radius, corners)
        profile = [(0.0, -half), (radius, -half), (radius, half), (0.0, half)]
        return of_mesh(*_revolved(profile, corners))
    if isinstance(geometry, Sphere):
        angles, radius = np.linspace(-math.pi / 2.0, math.pi / 2.0, corners // 2 + 1), geometry.radius
        radius += circle_error(radius, corners)
        profile = [(radius * math.cos(a), radius * math.sin(a)) for a in angles]
        return of_mesh(*_revolved(profile, corners))
    raise TypeError("no primitive: %r" % (geometry,))


def flat(corners: npt.ArrayLike) -> np.ndarray:
    """Triangles of the corners (3 m, 3), with the normals of their planes."""
    corners = np.asarray(corners, dtype=float).reshape(-1, 3, 3)
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    across /= np.maximum(np.linalg.norm(across, axis=1), 1e-30)[:, None]
    return np.concatenate([corners, np.repeat(across[:, None], 3, axis=1)], axis=2).reshape(-1, 6).astype(np.float32)


def circle_error(radius: float, corners: int) -> float:
    """How far a polygon with so many ``corners`` is from its circle, in the unit of ``radius``: its corners are as far
    outside as the middles of its sides are inside."""
    return radius * math.tan(math.pi / (2.0 * corners)) ** 2


def uv_on_primitive(geometry: Box | Cylinder | Sphere, rows: np.ndarray) -> np.ndarray:
    """The places of the corners ``rows`` (3 m, 6) of a primitive in a picture, as Gazebo's MeshManager has them:
    (3 m, 2), to the right and down from its upper left corner, in widths and heights of it.

    Each side of a box shows the whole picture, upright on the four sides; on the top, its upper edge is at +x. It goes
    once around cylinders and spheres.
    """
    points, normals = rows[:, :3].astype(float), rows[:, 3:]
    if isinstance(geometry, Box):
        x, y, z = (points / geometry.size).T
        nx, ny, nz = np.abs(normals).T
        side_on = np.sign(normals)
        right = np.select([nx > 0.5, ny > 0.5], [y * side_on[:, 0], -x * side_on[:, 1]], -y)
        up = np.where(nz > 0.5, x * side_on[:, 2], z)
        return np.column_stack([0.5 + right, 0.5 - up])
    if isinstance(geometry, Cylinder):
        # Upside down: its first row is at the bottom.
        sideways, forward, down = points[:, 0], points[:, 1], 0.5 + points[:, 2] / geometry.length
    else:
        # Corners are rounded to 32 bits, and may be a little outside.
        down = np.arccos(np.clip(points[:, 1] / geometry.radius, -1.0, 1.0)) / math.pi
        sideways, forward = points[:, 0], points[:, 2]
    around = (np.arctan2(sideways, forward) / (2.0 * math.pi)).reshape(-1, 3)
    # The corners on the axis are at no angle; each triangle has them in its middle.
    on_axis = (np.hypot(sideways, forward) < 1e-5 * geometry.radius).reshape(-1, 3)
    around[on_axis] = np.nan
    # A triangle does not go back around the other way.
    around += around < np.nanmax(around, axis=1, keepdims=True) - 0.5
    return np.column_stack([np.where(on_axis, np.nanmean(around, axis=1, keepdims=True), around).ravel(), down])


def indexed(vertices: np.ndarray, normals: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Triangles of vertices (n, 3) [m] with normals (n, 3), and faces (m, 3)."""
    return np.hstack([vertices, normals]).astype(np.float32)[faces.ravel()]


def of_mesh(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Triangles of vertices (n, 3) [m] and faces (m, 3), smooth where faces meet at a small angle. Triangles without
    area are left out."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    faces = faces[np.linalg.norm(np.cross(b - a, c - a), axis=1) > 1e-12]
    normals = corner_normals(vertices, faces).reshape(-1, 3)
    return np.hstack([vertices[faces.ravel()], normals]).astype(np.float32)


def _box(half):
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
    faces = [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1),
             (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)]
    return of_mesh(signs * half, np.array(faces))


def _revolved(profile, corners):
    """Vertices and faces of a profile of (radius, height), bottom to top, turned about z."""
    angles = 2.0 * math.pi * np.arange(corners) / corners
    vertices = np.array([(r * math.cos(a), r * math.sin(a), z) for r, z in profile for a in angles])
    faces = []
    for ring in range(len(profile) - 1):
        for i in range(corners):
            a, b = ring * corners + i, ring * corners + (i + 1) % corners
            faces += [(a, b, b + corners), (a, b + corners, a + corners)]
    return vertices, np.array(faces)
