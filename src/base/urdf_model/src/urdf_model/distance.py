# SPDX-License-Identifier: BSD-3-Clause
"""How far a point is from a shape: which of several shapes a contact belongs to."""

from __future__ import annotations

import numpy as np

from .model import Box, Cylinder, Plane, Shape, Sphere
from .transforms import inverse

# A mesh's triangles are not searched: it counts as so far away [m], a little more with the distance of its origin. So a
# shape with a formula that is nearer goes first.
_MESH_IS_AT_M, _PER_M = 0.002, 1e-3


def distance_from(shape: Shape, point: np.ndarray) -> float:
    """Return the distance [m] of ``point`` (3,), in the frame of the shape's body, from the surface; below 0 inside."""
    point, geometry = (inverse(shape.origin) @ (*point, 1.0))[:3], shape.geometry
    if isinstance(geometry, Sphere):
        return float(np.linalg.norm(point)) - geometry.radius
    if isinstance(geometry, Plane):
        return float(point[2])
    if isinstance(geometry, Box):
        beyond = np.abs(point) - np.array(geometry.size) / 2.0
    elif isinstance(geometry, Cylinder):
        beyond = np.array([np.hypot(*point[:2]) - geometry.radius, abs(point[2]) - geometry.length / 2.0])
    else:
        return _MESH_IS_AT_M + _PER_M * float(np.linalg.norm(point))
    return float(np.linalg.norm(np.maximum(beyond, 0.0)) + min(beyond.max(), 0.0))
