# SPDX-License-Identifier: BSD-3-Clause
"""Covers a solid by few spheres that exceed it only a little, and a mesh by boxes.

A sphere whose centre is at depth d in the solid and whose radius is d + tolerance exceeds it by at most ``tolerance``.
A greedy choice takes the sphere that contains the most samples not yet contained. Samples are on the surface and
inside; each must be contained with a margin, so that the points between the samples are contained, too.
"""
from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from motion_planning.shapes import TriangleMesh
from motion_planning.spheres import covering
from urdf_model import Box, Cylinder, Sphere

if TYPE_CHECKING:
    from motion_planning.shapes import Geometry, Placed

# Distance of samples [tolerances]; points between them are at most half a diagonal of their squares away.
_SPACING = 0.5
_BETWEEN = 0.75 * _SPACING
# Greatest number of samples times centres of a box or cylinder, estimated by its area and volume: larger ones get a
# larger tolerance. Long and thin ones have more samples than that, at most by this factor.
_MOST, _MAX_IF_THIN = 40_000_000, 8
# Samples of a mesh are at most this far from each of its points, and voxels have this size [tolerances].
_MESH_SPACING, _MESH_CELL = 0.3, 0.6
# Half of the largest side [m].
_LARGEST = 1e4
# Sides of the small triangles at whose corners a mesh is sampled, and of cubes with one sample each [distances of
# samples]: 0.8 / sqrt(3) + 0.3 sqrt(3) < 1.
_SIDES, _CUBES = 0.8, 0.3
# Number of samples of a mesh that are made at a time, which bounds memory.
_AT_ONCE = 500_000
# The outside of a mesh is extended by at most so many sweeps; what they do not reach in a maze counts as inside.
_MAX_SWEEPS = 24
#: Added to each radius [m]: rounding error of single floats.
ROUNDING = 2e-5


class WorkBound(NamedTuple):
    """Greatest work, beyond which geometry gets a larger tolerance. samples: of a mesh's surface; voxels: of the box
    around it; distances: samples times centres; spheres: of anything."""

    samples: int
    voxels: int
    distances: int
    spheres: int


#: For links of a robot, which are covered once and kept on disk. Most are meshes of half a metre; they take a second.
OF_LINKS = WorkBound(8_000_000, 20_000_000, 1_000_000_000, 1_000_000)
#: For objects of a scene, while a plan waits: a few tenths of a second.
OF_OBJECTS = WorkBound(2_000_000, 4_000_000, 200_000_000, 2_000)


class CoverError(ValueError):
    """Geometry that cannot be covered; the text names it."""


def cover(parts: Sequence[Placed], tolerance: float) -> np.ndarray:
    """Return spheres (n, 4), centre and radius, that contain all ``parts`` and reach ``tolerance`` [m] beyond them.

    parts: [(geometry, pose (4, 4))]; geometry: Box, Cylinder or Sphere of urdf_model, or TriangleMesh. A mesh
    counts as solid if its surface is closed up to gaps of ``tolerance``. Large geometry gets a larger tolerance. Raises
    CoverError.
    """
    return _cover(parts, tolerance, OF_LINKS)[0]


def cover_object(parts: Sequence[Placed], tolerance: float) -> np.ndarray:
    """``cover`` with the bounds of OF_OBJECTS: (1 + n, 4), the tolerance that was used [m] in the first row's first
    place, then the spheres. Raises CoverError."""
    spheres, used = _cover(parts, tolerance, OF_OBJECTS)
    return np.concatenate([[[used, 0.0, 0.0, 0.0]], spheres])


def _cover(parts: Sequence[Placed], tolerance: float, bound: WorkBound) -> tuple[np.ndarray, float]:
    """The spheres (n, 4), and the tolerance [m] that was used."""
    alone = [(geometry, pose) for geometry, pose in parts if isinstance(geometry, Sphere)]
    found = [np.append(pose[:3, 3], geometry.radius + ROUNDING) for geometry, pose in alone]
    solids = [_solid(geometry, pose, tolerance, bound) for geometry, pose in parts if not isinstance(geometry, Sphere)]
    if not solids:
        return np.array(found).reshape(-1, 4), tolerance
    wanted = np.concatenate([solid.samples for solid in solids])
    between = max(solid.between for solid in solids)
    for sphere in found:
        wanted = wanted[np.linalg.norm(wanted - sphere[:3], axis=1) > sphere[3] - between]
    centres = np.concatenate([solid.inside for solid in solids])
    depth = np.zeros(len(centres))
    for solid in solids:
        np.maximum(depth, solid.depth(centres), out=depth)
    used = max(solid.tolerance for solid in solids)
    radii = depth + used
    chosen = _greedy(wanted, centres, radii - between)
    if len(chosen) > bound.spheres:
        return _cover(parts, 2.0 * used, bound)
    spheres = np.column_stack([centres[chosen], radii[chosen] + ROUNDING])
    return np.concatenate([np.array(found).reshape(-1, 4), _shrunk(spheres, wanted, between)]), used


def ball(spheres: np.ndarray, steps: int = 100) -> np.ndarray:
    """Return (4,): a ball around all ``spheres`` (n, 4), made smaller by ``steps`` towards the farthest sphere."""
    return covering.ball(np.ascontiguousarray(spheres, dtype=float), steps) + [0.0, 0.0, 0.0, ROUNDING]


def _greedy(wanted: np.ndarray, centres: np.ndarray, reach: np.ndarray) -> np.ndarray:
    """Indices of centres whose balls with radius ``reach`` contain all points ``wanted``, most points first."""
    balls = np.column_stack([centres, np.square(np.maximum(reach, 0.0))]).astype(np.float32)
    chosen = np.empty(len(balls), dtype=np.int64)
    number, left = covering.choose(covering.by_axes(wanted), len(wanted), balls, chosen)
    if left:
        raise CoverError("%d of %d samples of a solid are in no sphere; its parts may be too different in size"
                         % (left, len(wanted)))
    return chosen[:number]


def _shrunk(spheres: np.ndarray, wanted: np.ndarray, between: float) -> np.ndarray:
    """Without the spheres whose points others contain as well, each as small as the points that only it contains
    allow."""
    # They were chosen in single precision.
    reach = spheres + [0.0, 0.0, 0.0, 0.1 * ROUNDING]
    spheres, room = spheres.copy(), 8 * len(wanted)
    while True:
        starts, inside, far = np.empty(len(spheres) + 1, np.int64), np.empty(room, np.int64), np.empty(room)
        count = covering.within(np.ascontiguousarray(wanted), reach, between + ROUNDING, starts, inside, far)
        if count <= room:
            break
        room = count
    members, apart = np.split(inside[:count], starts[1:-1]), np.split(far[:count], starts[1:-1])
    times = np.bincount(np.concatenate([*members, np.empty(0, dtype=int)]), minlength=len(wanted))
    kept = []
    for k, inside in enumerate(members):
        if (times[inside] > 1).all():
            times[inside] -= 1
        else:
            kept.append(k)
    for k in sorted(kept, key=lambda k: -spheres[k, 3]):
        alone = times[members[k]] == 1
        spheres[k, 3] = min(spheres[k, 3], max(apart[k][alone].max(initial=0.0), 1e-4))
        times[members[k][apart[k] > spheres[k, 3] + 0.1 * ROUNDING]] -= 1
    return spheres[kept]


class _solid_box:
    """A box or a cylinder: samples of it, points inside, and the depth of points."""

    def __init__(self, geometry: Box | Cylinder, pose: np.ndarray, tolerance: float) -> None:
        self._geometry, self._pose = geometry, pose
        box = isinstance(geometry, Box)
        half = 0.5 * np.array(geometry.size if box else [2 * geometry.radius, 2 * geometry.radius, geometry.length])
        if not ((half >= 0.0) & (half <= _LARGEST)).all():
            raise CoverError("a solid has sizes %s m; expected from 0 to %g" % (2.0 * half, 2.0 * _LARGEST))
        # Estimated number of samples and centres; a large solid is sampled more coarsely.
        area, volume = 8.0 * (half * np.roll(half, 1)).sum(), 8.0 * half.prod()
        while (area / (tolerance * _SPACING) ** 2) * (volume / tolerance**3 + area / tolerance**2) > _MOST or \
                _distances(half, tolerance) > _MAX_IF_THIN * _MOST:
            tolerance *= 1.25
        spacing, self.tolerance = tolerance * _SPACING, tolerance
        self.between = spacing * _BETWEEN / _SPACING
        # Along an edge the spheres are small: the distance of centres must not exceed the tolerance.
        if box:
            samples, inside = _box_surface(half, spacing), _grid(half, tolerance)
        else:
            samples, inside = _cylinder_surface(geometry, spacing), _cylinder_grid(geometry, tolerance)
        self.samples = _moved(pose, np.concatenate([samples, inside]))
        self.inside = _moved(pose, inside)

    def depth(self, points: np.ndarray) -> np.ndarray:
        geometry = self._geometry
        local = (points - self._pose[:3, 3]) @ self._pose[:3, :3]
        if isinstance(geometry, Box):
            return (0.5 * np.array(geometry.size) - np.abs(local)).min(axis=1)
        return np.minimum(geometry.radius - np.hypot(local[:, 0], local[:, 1]),
                          0.5 * geometry.length - np.abs(local[:, 2]))


class _solid_mesh:
    """A mesh as voxels: those of its surface and those that it encloses."""

    def __init__(self, mesh: TriangleMesh, pose: np.ndarray, tolerance: float, bound: WorkBound) -> None:
        vertices, triangles = used_corners(np.asarray(mesh.vertices, dtype=float).reshape(-1, 3),
                                           np.asarray(mesh.triangles).reshape(-1, 3))
        # Surface voxels have no depth: the tolerance alone must extend a sphere to their corners.
        while True:
            cell, spacing = _MESH_CELL * tolerance, _MESH_SPACING * tolerance
            if sample_count(vertices, triangles, spacing) <= bound.samples and \
                    voxel_count(vertices, cell) <= bound.voxels:
                samples = mesh_samples(vertices, triangles, spacing)
                full, lowest = voxels([samples], cell)
                cells = np.argwhere(full)
                more = len(samples) * len(cells) / bound.distances
                if more <= 1.0:
                    break
                # The product grows with the fifth power at most: these steps would all be too small.
                tolerance *= 1.25 ** max(0, int(np.log(more) / (5.0 * np.log(1.25))) - 1)
            tolerance *= 1.25
        self.tolerance, self.between = tolerance, spacing
        self._surface = _moved(pose, samples)
        self.samples = self._surface
        self.inside = _moved(pose, lowest + (cells + 0.5) * cell)
        self._inside_depth = self._distance(self.inside) - self.between
        surface, _ = voxels([samples], cell, fill=False)
        self._inside_depth[surface[tuple(cells.T)]] = 0.0

    def depth(self, points: np.ndarray) -> np.ndarray:
        """The depth of points of ``inside``; 0 elsewhere, which is a lower bound."""
        depth = np.zeros(len(points))
        own = {tuple(p): d for p, d in zip(self.inside.tolist(), self._inside_depth, strict=True)}
        for i, point in enumerate(points.tolist()):
            depth[i] = own.get(tuple(point), 0.0)
        return depth

    def _distance(self, points: np.ndarray) -> np.ndarray:
        nearest = np.empty(len(points), dtype=np.float32)
        covering.nearest(covering.by_axes(self._surface), len(self._surface), points.astype(np.float32), nearest)
        return nearest.astype(float)


def _solid(geometry: Geometry, pose: np.ndarray, tolerance: float, bound: WorkBound) -> _solid_box | _solid_mesh:
    if isinstance(geometry, (Box, Cylinder)):
        return _solid_box(geometry, pose, tolerance)
    if isinstance(geometry, TriangleMesh):
        return _solid_mesh(geometry, pose, tolerance, bound)
    raise CoverError("a %s cannot be covered; expected a box, a cylinder, a sphere or a mesh" % type(geometry).__name__)


def _moved(pose: np.ndarray, points: np.ndarray) -> np.ndarray:
    return points @ pose[:3, :3].T + pose[:3, 3]


def _distances(half: np.ndarray, tolerance: float) -> float:
    """Number of samples times centres of a box with half sides (3,)."""
    u, v, w = 2.0 * np.ceil(half / (tolerance * _SPACING)) + 1.0
    centres = (2.0 * np.ceil(half / tolerance) + 1.0).prod()
    return (2.0 * (u * v + v * w + w * u) + centres) * centres


def _line(half: float, spacing: float) -> np.ndarray:
    """Points from -half to half, an odd number, so that the middle is one of them."""
    count = 2 * int(np.ceil(half / spacing)) + 1
    return np.linspace(-half, half, count)


def _grid(half: np.ndarray, spacing: float) -> np.ndarray:
    return np.stack(np.meshgrid(*(_line(h, spacing) for h in half), indexing="ij"), axis=-1).reshape(-1, 3)


def _box_surface(half: np.ndarray, spacing: float) -> np.ndarray:
    sides = []
    for axis in range(3):
        others = [k for k in range(3) if k != axis]
        u, v = np.meshgrid(*(_line(half[k], spacing) for k in others), indexing="ij")
        for sign in (-1.0, 1.0):
            side = np.empty((u.size, 3))
            side[:, axis], side[:, others[0]], side[:, others[1]] = sign * half[axis], u.ravel(), v.ravel()
            sides.append(side)
    return np.concatenate(sides)


def _disc(radius: float, spacing: float) -> np.ndarray:
    """Points (n, 2) on rings from the middle to the rim, at most ``spacing`` apart along rings and between them."""
    steps = max(1, int(np.ceil(radius / spacing)))
    points = [np.zeros((1, 2))]
    for k in range(1, steps + 1):
        angle = _around(radius * k / steps, spacing)
        points.append(radius * k / steps * np.column_stack([np.cos(angle), np.sin(angle)]))
    return np.concatenate(points)


def _around(radius: float, spacing: float) -> np.ndarray:
    count = max(8, int(np.ceil(2.0 * np.pi * radius / spacing)))
    return 2.0 * np.pi * np.arange(count) / count


def _cylinder_surface(cylinder: Cylinder, spacing: float) -> np.ndarray:
    # A circle bulges beyond the line between two samples, so they are a little closer.
    angle, z = _around(cylinder.radius, 0.9 * spacing), _line(0.5 * cylinder.length, spacing)
    angle, z = (grid.ravel() for grid in np.meshgrid(angle, z))
    return np.concatenate([np.column_stack([cylinder.radius * np.cos(angle), cylinder.radius * np.sin(angle), z]),
                           _stacked(_disc(cylinder.radius, 0.9 * spacing),
                                    0.5 * cylinder.length * np.array([-1.0, 1.0]))])


def _cylinder_grid(cylinder: Cylinder, spacing: float) -> np.ndarray:
    return _stacked(_disc(cylinder.radius, spacing), _line(0.5 * cylinder.length, spacing))


def _stacked(disc: np.ndarray, heights: np.ndarray) -> np.ndarray:
    """The points (n, 2) at each of the heights."""
    return np.column_stack([np.tile(disc, (len(heights), 1)), np.repeat(heights, len(disc))])


def used_corners(vertices: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return (vertices, triangles) without the vertices of no triangle. Raises CoverError for a mesh without triangles
    or with corners that are not finite."""
    if not len(triangles) or not np.isfinite(vertices[triangles]).all():
        raise CoverError("a mesh has %d triangles and %s corners; expected at least one, and finite corners"
                         % (len(triangles), "infinite" if len(triangles) else "no"))
    used, renamed = np.unique(triangles, return_inverse=True)
    return vertices[used], renamed.reshape(triangles.shape)


def sample_count(vertices: np.ndarray, triangles: np.ndarray, spacing: float) -> float:
    """Return the number of points that ``mesh_samples`` makes, as a float."""
    parts = _parts_of_sides(vertices[triangles], spacing)
    return len(vertices) + float((0.5 * (parts + 1.0) * (parts + 2.0))[parts > 1.0].sum())


def _parts_of_sides(corners: np.ndarray, spacing: float) -> np.ndarray:
    """Into how many parts each side of triangles (m, 3, 3) is divided, (m,) float."""
    longest = np.max([np.linalg.norm(corners[:, i] - corners[:, i - 1], axis=1) for i in range(3)], axis=0)
    # A point of a triangle with no longer side than 1 is at most 1 / sqrt(3) from a corner.
    return np.maximum(1.0, np.ceil(longest / (_SIDES * spacing)))


def points_on(vertices: np.ndarray, triangles: np.ndarray, spacing: float) -> Iterator[np.ndarray]:
    """Yield points (n, 3), some at a time, on the triangles, none of whose points is further than ``spacing`` from
    one."""
    yield vertices
    parts = _parts_of_sides(vertices[triangles], spacing)
    for count in np.unique(parts[parts > 1.0]).astype(int):
        some = vertices[triangles[parts == count]]
        i, j = np.indices((count + 1, count + 1)).reshape(2, -1)
        i, j = i[i + j <= count] / count, j[i + j <= count] / count
        weights = np.column_stack([1.0 - i - j, i, j])
        at_once = max(1, _AT_ONCE // len(weights))
        for begin, first in itertools.product(range(0, len(some), at_once), range(0, len(weights), _AT_ONCE)):
            yield np.matmul(weights[first : first + _AT_ONCE], some[begin : begin + at_once]).reshape(-1, 3)


def mesh_samples(vertices: np.ndarray, triangles: np.ndarray, spacing: float) -> np.ndarray:
    """Return points (n, 3) on the triangles, none of whose points is further than ``spacing`` from one of them."""
    # One sample is enough for a cube with such sides; small triangles have many in one. The numbers of cubes have the
    # order of their rows, which take np.unique ten times as long.
    lowest = np.floor(vertices.min(axis=0) / (_CUBES * spacing)).astype(np.int64) - 1
    shape = np.floor(vertices.max(axis=0) / (_CUBES * spacing)).astype(np.int64) - lowest + 2
    kept = []
    for points in points_on(vertices, triangles, spacing):
        cubes = np.floor(points / (_CUBES * spacing)).astype(np.int64) - lowest
        numbers, first = np.unique(np.ravel_multi_index(tuple(cubes.T), shape, mode="clip"), return_index=True)
        kept.append((numbers, points[first]))
    _, first = np.unique(np.concatenate([numbers for numbers, _ in kept]), return_index=True)
    return np.concatenate([points for _, points in kept])[first]


def voxel_count(vertices: np.ndarray, pitch: float) -> float:
    """Return the number of cells of size ``pitch`` that ``voxels`` looks at, as a float."""
    return float((np.ptp(vertices, axis=0) / pitch + 4.0).prod())


def voxels(samples: Iterable[np.ndarray], pitch: float, fill: bool = True) -> tuple[np.ndarray, np.ndarray]:
    """Return (cells (a, b, c) bool, corner (3,)): those of size ``pitch`` that hold samples, or that these enclose.

    samples: iterable of arrays of points (n, 3); the first ones have all others between them.
    """
    samples = iter(samples)
    first = next(samples)
    lowest = first.min(axis=0) - 1.5 * pitch
    full = np.zeros(np.floor((first.max(axis=0) - lowest) / pitch).astype(int) + 2, dtype=bool)
    for points in itertools.chain([first], samples):
        full[tuple(np.floor((points - lowest) / pitch).astype(int).T)] = True
    if not fill:
        return full, lowest
    outside = np.zeros_like(full)
    outside[0], outside[-1], outside[:, 0], outside[:, -1], outside[:, :, 0], outside[:, :, -1] = (True,) * 6
    outside &= ~full
    count = -1
    for _ in range(_MAX_SWEEPS):
        if count == outside.sum():
            break
        count = outside.sum()
        # Sweeps extend the outside as far as possible along each axis, both ways.
        for axis in range(3):
            for way in (slice(None), slice(None, None, -1)):
                sweep, wall = np.moveaxis(outside, axis, 0)[way], np.moveaxis(full, axis, 0)[way]
                for k in range(1, len(sweep)):
                    sweep[k] |= sweep[k - 1] & ~wall[k]
    return ~outside, lowest


def boxes_of_cells(full: np.ndarray, lowest: np.ndarray, pitch: float, beyond: float = 0.0,
                   most: int | None = None) -> np.ndarray:
    """Return boxes (n, 2, 3), least and greatest corner, that together are the cells, each larger by ``beyond``. Raises
    CoverError if they are more than ``most``."""
    left, found = full.copy(), []
    flat, place = left.reshape(-1), 0
    while place < len(flat):
        step = int(flat[place:].argmax())
        place += step
        if not flat[place]:
            break
        if most is not None and len(found) >= most:
            raise CoverError("more than %d boxes" % most)
        start = np.array(np.unravel_index(place, full.shape))
        end = [int(k) + 1 for k in start]
        for axis in (2, 1, 0):
            while end[axis] < full.shape[axis]:
                slab = [slice(s, e) for s, e in zip(start, end, strict=True)]
                slab[axis] = slice(end[axis], end[axis] + 1)
                if not left[tuple(slab)].all():
                    break
                end[axis] += 1
        left[tuple(slice(s, e) for s, e in zip(start, end, strict=True))] = False
        found.append((lowest + pitch * start - beyond, lowest + pitch * np.array(end) + beyond))
    return np.array(found).reshape(-1, 2, 3)
