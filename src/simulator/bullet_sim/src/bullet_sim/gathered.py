# SPDX-License-Identifier: BSD-3-Clause
"""Links with more shapes than PyBullet accepts: the surplus goes into files.

PyBullet has room for 16 shapes per body and writes beyond its buffer, which crashes the process. A file holds any
number: of convex bodies, one object each, or of triangles. Meshes stay exact; boxes lose their sharp edges (by a
millimetre); cylinders and balls become bodies with flat faces, inside the round ones by at most half a per cent of the
radius. As many of them as possible stay primitives.
"""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from urdf_model import Box, Cylinder, Mesh, Sphere

from .mesh_loading import even_directions, parts_as_wavefront

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from pathlib import Path

#: PyBullet's limit for one body (MAX_COMPOUND_COLLISION_SHAPES).
MAX_SHAPES = 16
# Bullet keeps this distance around convex bodies that come from a file [m]; bodies that have none are made smaller.
_MARGIN_M = 0.001
# Of a cylinder's ends, and of a ball: 1 - cos(pi / 32) = 0.5 %, and no direction is more than 0.1 rad from a point.
_CORNERS = 32
_BALL_POINTS = 800
# Kinds of shapes, those that lose most accuracy in a file first.
_ORDER = (Sphere, Cylinder, Box, Mesh)


class BulletShape(NamedTuple):
    """A shape in PyBullet's terms."""

    geometry: Any  # of urdf_model; of a mesh only the scale counts here
    file: str  # Wavefront file of a mesh, [m] before the scale; "" for another geometry
    origin: np.ndarray  # (4, 4)
    hollow: bool  # triangles, instead of convex bodies


def gathered(parts: list[BulletShape], keep: Callable[[bytes, Callable[[], list[str]]], str]) -> list[BulletShape]:
    """Return a list of at most MAX_SHAPES Parts with the same collision geometry as ``parts``.

    ``keep(key, lines)`` returns the path of a file that holds the result of ``lines()``, cached under ``key``.
    """
    if len(parts) <= MAX_SHAPES:
        return parts
    order = sorted(parts, key=lambda part: _ORDER.index(type(part.geometry)))
    few, many = order[: MAX_SHAPES - 2], order[MAX_SHAPES - 2 :]
    for hollow, lines in ((True, _triangles), (False, _bodies)):
        chosen = [part for part in many if part.hollow == hollow]
        if chosen:
            # The loop computes the key, too, when the file exists already: a thousand matrices as text would take 20
            # ms.
            key = repr([(part.geometry, part.file) for part in chosen] + [hollow]).encode()
            key += b"".join(part.origin.tobytes() for part in chosen)
            file = keep(key, lambda lines=lines, chosen=chosen: lines(chosen))
            few.append(BulletShape(Mesh(file), file, np.eye(4), hollow))
    return few


def _bodies(parts: Iterable[BulletShape]) -> list[str]:
    """Return the lines of a Wavefront file with one object for each convex body."""
    return parts_as_wavefront(
        [
            [tuple(point) for point in _placed(points, part.origin).tolist()]
            for part in parts
            for points in _convex(part)
        ]
    )


def _convex(part: BulletShape) -> list[np.ndarray]:
    """Return for each convex body of a BulletShape its points (n, 3), in the Part's own axes."""
    geometry = part.geometry
    if isinstance(geometry, Mesh):
        return [points * geometry.scale for points, _ in _objects(part.file)]
    if isinstance(geometry, Box):
        halves = np.array([_less(side / 2.0) for side in geometry.size])
        return [halves * list(itertools.product((-1.0, 1.0), repeat=3))]
    if isinstance(geometry, Cylinder):
        turn = 2.0 * np.pi * np.arange(_CORNERS) / _CORNERS
        ring = _less(geometry.radius) * np.stack([np.cos(turn), np.sin(turn), 0.0 * turn], axis=1)
        top = np.array([0.0, 0.0, _less(geometry.length / 2.0)])
        return [np.concatenate([ring + top, ring - top])]
    return [_less(geometry.radius) * even_directions(_BALL_POINTS)]


def without_margin(part: BulletShape) -> BulletShape:
    """Return a BulletShape of a mesh that is as large with the margin that Bullet adds as ``part`` is without; any
    other part as it is."""
    if part.hollow or not isinstance(part.geometry, Mesh):
        return part
    scale = np.asarray(part.geometry.scale, dtype=float)
    points = np.concatenate(_convex(part))
    low, high = points.min(axis=0), points.max(axis=0)
    halves, middle = (high - low) / 2.0, (high + low) / 2.0
    smaller = np.array([_less(half) / half if half > 0.0 else 1.0 for half in halves])
    origin = part.origin.copy()
    origin[:3, 3] += origin[:3, :3] @ ((1.0 - smaller) * middle)
    return part._replace(geometry=replace(part.geometry, scale=tuple((smaller * scale).tolist())), origin=origin)


def _less(half_m: float) -> float:
    """Return half a size less the margin that Bullet adds; a thinner size stays as it is."""
    return half_m - _MARGIN_M if half_m > 2.0 * _MARGIN_M else half_m


def _triangles(parts: Iterable[BulletShape]) -> list[str]:
    """Return the lines of a Wavefront file with all triangles of ``parts``."""
    vertices, faces, first = [], [], 1
    for part in parts:
        for points, triangles in _objects(part.file):
            placed = _placed(points * part.geometry.scale, part.origin)
            vertices += ["v %.9g %.9g %.9g" % tuple(point) for point in placed]
            faces += ["f %d %d %d" % tuple(triangle) for triangle in triangles + first]
            first += len(points)
    return ["o mesh", *vertices, *faces]


def corners(path: str | Path) -> np.ndarray:
    """The corners (3 m, 3) of the triangles in a Wavefront file of ours. Raises OSError, ValueError."""
    return np.concatenate([points[triangles.ravel()] for points, triangles in _objects(path)])


def _objects(path: str | Path) -> list[list[np.ndarray]]:
    """Return (points (n, 3), triangles (m, 3) from 0) of each object of a Wavefront file of ours."""
    found, first = [], 1
    with open(path, encoding="ascii") as file:
        for kind, lines in itertools.groupby((line.split() for line in file), key=lambda words: words[0]):
            values = [words[1:] for words in lines]
            if kind == "v":
                found.append([np.array(values, dtype=float), np.zeros((0, 3), dtype=int)])
            elif kind == "f":
                found[-1][1] = np.array(values, dtype=int) - first
                first += len(found[-1][0])
    return found


def _placed(points: np.ndarray, origin: np.ndarray) -> np.ndarray:
    return points @ origin[:3, :3].T + origin[:3, 3]
