# SPDX-License-Identifier: BSD-3-Clause
"""Shapes as bare triangles with normals, ready for a graphics pipeline. ROS-free.

Triangles are float32 arrays (3 m, 6): three rows for each triangle, a row is x y z [m] and the unit normal there.
"""
import math

import numpy as np

from urdf_model import Box, Cylinder, Sphere

# Faces that meet at less than this angle look like one smooth surface [rad].
CREASE_RAD = math.radians(40.0)
_CIRCLE = 32


def of_primitive(geometry):
    """Triangles of a ``urdf_model`` Box, Cylinder or Sphere about its own origin; ``TypeError`` for anything else."""
    if isinstance(geometry, Box):
        return _box(np.asarray(geometry.size) / 2.0)
    if isinstance(geometry, Cylinder):
        half = geometry.length / 2.0
        profile = [(0.0, -half), (geometry.radius, -half), (geometry.radius, half), (0.0, half)]
        return of_mesh(*_revolved(profile))
    if isinstance(geometry, Sphere):
        angles = np.linspace(-math.pi / 2.0, math.pi / 2.0, _CIRCLE // 2 + 1)
        return of_mesh(*_revolved([(geometry.radius * math.cos(a), geometry.radius * math.sin(a)) for a in angles]))
    raise TypeError("no primitive: %r" % (geometry,))


def of_wavefront(path):
    """Triangles of a Wavefront file of bare vertices and triangles, as ``world_picture.drawing`` writes them."""
    vertices, faces = [], []
    with open(path, encoding="ascii") as file:
        for line in file:
            words = line.split()
            if words[0] == "v":
                vertices.append(words[1:4])
            elif words[0] == "f":
                faces.append(words[1:4])
    return of_mesh(np.array(vertices, dtype=float), np.array(faces, dtype=int) - 1)


def of_mesh(vertices, faces):
    """Triangles of vertices (n, 3) and faces (m, 3). Normals are smooth except at edges sharper than
    :data:`CREASE_RAD`.

    Triangles without area are left out.
    """
    corners = vertices[faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    double_area = np.linalg.norm(cross, axis=1)
    solid = double_area > 1e-12
    faces, corners, cross = faces[solid], corners[solid], cross[solid]
    flat = cross / double_area[solid, None]
    if not len(faces):
        return np.zeros((0, 6), dtype=np.float32)

    # Each corner averages the faces at its vertex with nearly the same orientation, weighted by area.
    vertex = faces.ravel()
    face = np.repeat(np.arange(len(faces)), 3)
    order = np.argsort(vertex, kind="stable")
    _, start, count = np.unique(vertex[order], return_index=True, return_counts=True)
    groups = np.repeat(np.arange(len(start)), count)
    neighbours = count[groups]
    mine = np.repeat(np.arange(len(order)), neighbours)
    ends = np.cumsum(neighbours)
    theirs = start[groups[mine]] + np.arange(ends[-1]) - np.repeat(ends - neighbours, neighbours)
    my_face, their_face = face[order[mine]], face[order[theirs]]
    alike = np.einsum("ij,ij->i", flat[my_face], flat[their_face]) > math.cos(CREASE_RAD)
    normals = np.zeros((len(order), 3))
    np.add.at(normals, order[mine[alike]], cross[their_face[alike]])
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-30)[:, None]
    return np.hstack([corners.reshape(-1, 3), normals]).astype(np.float32)


def _box(half):
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
    faces = [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1),
             (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)]
    return of_mesh(signs * half, np.array(faces))


def _revolved(profile):
    """Vertices and faces of a profile of (radius, height), bottom to top, turned about z."""
    angles = 2.0 * math.pi * np.arange(_CIRCLE) / _CIRCLE
    vertices = np.array([(r * math.cos(a), r * math.sin(a), z) for r, z in profile for a in angles])
    faces = []
    for ring in range(len(profile) - 1):
        for i in range(_CIRCLE):
            a, b = ring * _CIRCLE + i, ring * _CIRCLE + (i + 1) % _CIRCLE
            faces += [(a, b, b + _CIRCLE), (a, b + _CIRCLE, a + _CIRCLE)]
    return vertices, np.array(faces)
