# SPDX-License-Identifier: BSD-3-Clause
"""Shapes of planning beyond those of a URDF. Lengths in m; each in its own frame."""
from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from command_line.options import counted

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import TypeAlias

    from numpy.typing import ArrayLike, DTypeLike

    from urdf_model import Box, Cylinder, Plane, Sphere

    #: The shapes that planning knows; one at its pose (4, 4); a function from a mesh's file name.
    Geometry: TypeAlias = "Box | Cylinder | Sphere | Plane | Cone | TriangleMesh | Octree"
    Placed: TypeAlias = tuple[Geometry, np.ndarray]
    Meshes: TypeAlias = Callable[[str], "TriangleMesh"]

#: Levels of an octomap, from the cube around everything to the smallest.
OCTREE_DEPTH = 16


@dataclass(frozen=True)
class Cone:
    """Along z, centred at half its height: the base at -length / 2, the apex at +length / 2."""

    radius: float
    length: float


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """Triangles as they are, hollow. vertices (n, 3) float64; triangles (m, 3) int64, indices of vertices.

    Raises ValueError for no triangles, wrong shapes, indices out of range and numbers that are not finite.
    """

    vertices: np.ndarray
    triangles: np.ndarray

    def __post_init__(self) -> None:
        vertices, triangles = read_only(self.vertices), read_only(self.triangles, np.int64)
        if vertices.ndim != 2 or vertices.shape[1:] != (3,) or triangles.ndim != 2 or triangles.shape[1:] != (3,):
            raise ValueError("a mesh needs vertices (n, 3) and triangles (m, 3), got %s and %s"
                             % (vertices.shape, triangles.shape))
        if not len(triangles):
            raise ValueError("the mesh has %s and no triangles" % counted(len(vertices), "vertex", "vertices"))
        if triangles.min() < 0 or triangles.max() >= len(vertices):
            raise ValueError("triangles of the mesh name vertices %d to %d, but it has %d"
                             % (triangles.min(), triangles.max(), len(vertices)))
        if not np.isfinite(vertices).all():
            raise ValueError("the mesh has a vertex that is not finite")
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "triangles", triangles)

    @cached_property
    def corners(self) -> np.ndarray:
        """(k, 3): the vertices that belong to a triangle."""
        return self.vertices[np.unique(self.triangles)]


@dataclass(frozen=True, eq=False)
class Octree:
    """Occupied cubes of an octree. resolution [m]: side of the smallest; boxes (n, 4): centre x y z, and side.

    Raises ValueError for a side that is not the resolution times a power of 2, a cube off the grid of its size, and one
    too far from the origin for the tree, 32768 times the resolution.
    """

    resolution: float
    boxes: np.ndarray

    def __post_init__(self) -> None:
        boxes = read_only(np.reshape(np.asarray(self.boxes, dtype=float), (-1, 4)))
        if not self.resolution > 0.0 or not np.isfinite(boxes).all():
            raise ValueError("an octree needs a positive resolution and finite boxes, got resolution %r"
                             % (self.resolution,))
        sides = boxes[:, 3]
        with np.errstate(over="ignore"):
            levels = np.rint(np.log2(np.maximum(sides, 1e-9) / self.resolution))
        wrong = (np.abs(self.resolution * 2.0 ** levels - sides) > 1e-3 * sides) | (levels < 0)
        wrong |= levels >= OCTREE_DEPTH
        if wrong.any():
            raise ValueError("a cube of the octree has side %g; expected the resolution, %g, times a power of 2"
                             % (sides[wrong][0], self.resolution))
        cells = boxes[:, :3] / sides[:, None] - 0.5
        if (np.abs(cells - np.rint(cells)) > 0.1).any():
            raise ValueError("a cube of the octree does not lie on the grid of its size")
        if (np.abs(boxes[:, :3]) + 0.5 * sides[:, None] > self.resolution * 2 ** (OCTREE_DEPTH - 1) * 1.0001).any():
            raise ValueError("a cube of the octree is more than %g m from its origin"
                             % (self.resolution * 2 ** (OCTREE_DEPTH - 1)))
        object.__setattr__(self, "boxes", boxes)


def read_only(array: ArrayLike, kind: DTypeLike = np.float64) -> np.ndarray:
    """Return a contiguous copy of ``array`` that cannot be written, or ``array`` itself if it is one already."""
    if isinstance(array, np.ndarray) and array.dtype == kind and array.flags.c_contiguous and not array.flags.writeable:
        return array
    copy = np.array(array, dtype=kind, order="C")
    copy.flags.writeable = False
    return copy
