# SPDX-License-Identifier: BSD-3-Clause
"""Meshes in levels of detail, each with its distance from the original. ROS-free.

Edges are collapsed in the order of their quadric error (Garland and Heckbert, "Surface simplification using quadric
error metrics", 1997), each level from the one before. A level keeps the normals of the original, so that it is shaded
like it: smooth surfaces show no facets, and creases stay.

A mesh with a picture is cut where the picture is: its seams are borders, and its levels have vertices of the original
alone, each with its own place in the picture.
"""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from bullet_sim.thinning import thin_out

#: Tolerance of the finest level as a share of the mesh's longest side, and of each further level as a multiple of the
#: one before. The measured distance from the original is about a third of a tolerance.
FINEST, COARSER, LEVELS = 1.0 / 500.0, 2.0, 7
#: No level is farther from the original than this share of the size: it would be another shape.
FARTHEST = 1.0 / 30.0
#: Most triangles of a level.
MOST = 40_000
#: Faces of the original that meet at less than this angle are one smooth surface [rad].
CREASE_RAD = math.radians(40.0)
#: The distance of a level from the original is the one that this share of the original's surface keeps.
COUNTED = 0.99
#: The same where there is a picture: such models often have few and large triangles, of which one more counts.
COUNTED_TEXTURED = 0.999
# A mesh with more triangles is first merged on a grid: the reduction would take too long.
_MANY = 200_000
# Vertices within this share of a mesh's size are one: files often have a vertex for each corner of each triangle.
_WELD = 1e-5
# fast_simplification's threshold grows by this power: 1 is exact, and ends where a collapse costs more than 1e-9 * 103.
# With the square of a distance as cost, that is the square of 0.32 mm.
_EXACT, _QUICK = 1, 3
# The quick reduction tears loose sheets: it counts only if the surface keeps its area within this share. It also stops
# early at seams; more triangles than this times the target are too many.
_AREA_KEPT, _OVER_TARGET = 0.06, 1.7
_LAST_COST_M = (1e-9 * 103.0) ** 0.5
# So many of the original's vertices are compared with a level, evenly spread over the list.
_COMPARED = 5_000
# Meshes of fewer triangles stay as they are.
_FEWEST = 24
# A level with more than this share of the triangles of the one before is not worth its place.
_WORTH = 0.85
# A place in a picture counts as the same within this share of it; surfaces of less than its square have no picture.
_SAME_UV = 1e-5
_MIN_IN_PICTURE = _SAME_UV ** 2
# Width of the strips that hold borders, as a share of the mesh's size.
_STRIP = 0.02


class ReducedMesh(NamedTuple):
    """``vertices`` (n, 3), ``normals`` (n, 3), ``faces`` (m, 3): a vertex at a crease appears once for each side.
    ``error``: the distance from the original that :data:`COUNTED` of its surface keeps, in the unit of the vertices; a
    picture is shifted on the surface by no more. ``uv`` (n, 2): the vertices' places in the picture, or None."""

    vertices: np.ndarray
    normals: np.ndarray
    faces: np.ndarray
    error: float
    uv: np.ndarray | None = None


class ReductionError(Exception):
    """The reduction contradicts itself."""


class _Mesh(NamedTuple):
    """``corner_normals`` (m, 3, 3): the normal at each corner of ``faces`` (m, 3). ``of`` (k,): for each vertex of the
    original the one that is left of it. ``uv`` (n, 2): places in a picture, or None."""

    vertices: np.ndarray
    faces: np.ndarray
    corner_normals: np.ndarray
    of: np.ndarray
    uv: np.ndarray | None = None


def levels(vertices: npt.ArrayLike, faces: np.ndarray, size: float | None = None,
           uv: npt.ArrayLike | None = None) -> list[ReducedMesh]:
    """Return the list of :class:`ReducedMesh` of a mesh, the finest first: vertices (n, 3) and faces (m, 3).

    ``size``: the longest side of the object that the mesh belongs to; by default its own. Borders of open meshes stay
    within the tolerance, too. Triangles without area are left out; a mesh without any other has no levels.
    ``uv`` (n, 2): the vertices' places in a picture, in widths and heights of it; levels have none if there are too
    many triangles, or too many loose ones. With them, the finest level is the mesh itself, as seams show first.
    """
    vertices = np.asarray(vertices, dtype=float)
    size = float(np.ptp(vertices, axis=0).max()) if size is None else size
    original = _original(vertices, faces, size, uv)
    if not len(original.faces):
        return []
    found, mesh = [], original
    if original.uv is not None and len(original.faces) <= MOST:
        found.append(_level(original, original))
    for number in range(LEVELS):
        mesh = _next(mesh, size * FINEST * COARSER ** number)
        if not len(mesh.faces):
            break
        if len(mesh.faces) <= min(MOST, _WORTH * len(found[-1].faces) if found else MOST):
            level = _level(original, mesh)
            if found and level.error > FARTHEST * size:
                break
            found.append(level)
    if not found:
        mesh = _thinned(mesh)
        found = [_level(original, mesh)]
    return found


def _original(vertices, faces, size, uv):
    """The :class:`_Mesh` without repeated vertices and without triangles that have no area."""
    points, joined, _ = _welded(vertices, faces, size)
    if len(joined) > _MANY:
        points, joined, _ = _welded(*thin_out(points, joined, _MANY), size)
        uv = None
    joined = joined[_twice_areas(points, joined) > 1e-12 * size ** 2]
    if uv is None or not len(joined):
        return _Mesh(points, joined, corner_normals(points, joined), np.arange(len(points)))
    uv = np.asarray(uv, dtype=float)
    cut, faces, first = _welded(vertices, faces, size, uv)
    faces = faces[_twice_areas(cut, faces) > 1e-12 * size ** 2]
    # Light is smooth across seams: normals are those of the mesh that is not cut.
    _, at = _same(cut, size)
    uncut = np.zeros((at.max() + 1, 3))
    uncut[at] = cut
    return _Mesh(cut, faces, corner_normals(uncut, at[faces]), np.arange(len(cut)), uv[first])


def reduced(vertices: np.ndarray, faces: np.ndarray, target: float) -> tuple[np.ndarray, np.ndarray]:
    """(vertices, faces) with about the same surface as vertices (n, 3) and faces (m, 3) and about ``target`` triangles,
    whatever the distance. Borders may shrink.

    Where that loses surface, as with loose sheets and many small parts, vertices are merged on a grid instead
    (`bullet_sim.thinning`).
    """
    import fast_simplification

    size = float(np.ptp(vertices, axis=0).max())
    welded, joined, _ = _welded(vertices, faces, size)
    if len(joined) <= target:
        return welded, joined
    smooth = fast_simplification.simplify(
        welded.astype(np.float32), joined.astype(np.int32),  # pyright: ignore[reportArgumentType]  (float32 counts, too)
        target_count=int(target), agg=_QUICK)[:2]
    merged = thin_out(vertices, faces, target)
    whole = max(_twice_areas(vertices, faces).sum(), 1e-12)
    lost, lost_by_merging = (abs(1.0 - _twice_areas(*mesh).sum() / whole) for mesh in (smooth, merged))
    if len(smooth[1]) <= _OVER_TARGET * target and (lost < _AREA_KEPT or lost < lost_by_merging):
        return smooth
    return merged


def corner_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the unit normals (m, 3, 3) at the corners of faces (m, 3) with area: of vertices (n, 3), smooth but for
    edges sharper than :data:`CREASE_RAD`. Each averages the faces at its vertex that look alike, by area."""
    across = np.cross(vertices[faces[:, 1]] - vertices[faces[:, 0]], vertices[faces[:, 2]] - vertices[faces[:, 0]])
    return _gathered(np.arange(len(vertices)), faces, np.repeat(across[:, None, :], 3, axis=1), faces, _unit(across))


def _gathered(of, faces, weighted, new_faces, new_flat):
    """Corner normals (k, 3, 3) of ``new_faces`` (k, 3) with normals ``new_flat`` (k, 3): sums of ``weighted`` (m, 3, 3)
    at the corners of ``faces`` (m, 3) whose vertices became the corner (``of``) and that look alike."""
    place = of[faces.ravel()]
    order = np.argsort(place, kind="stable")
    place = place[order]
    theirs = weighted.reshape(-1, 3)[order]
    looks = _unit(theirs)
    corner = new_faces.ravel()
    mine, which = _pairs(place, corner)
    alike = np.einsum("ij,ij->i", new_flat[mine // 3], looks[which]) > math.cos(CREASE_RAD)
    mine, which = mine[alike], which[alike]
    normals = np.stack([np.bincount(mine, theirs[which, k], len(corner)) for k in range(3)], axis=1)
    alone = np.linalg.norm(normals, axis=1) < 1e-30
    normals[alone] = np.repeat(new_flat, 3, axis=0)[alone]
    return _unit(normals).reshape(-1, 3, 3)


def _next(mesh, tolerance):
    """The mesh without the edges whose collapse costs less than the tolerance.

    The error of a flat sheet does not change when its border moves inwards: without more, sheets would shrink to
    nothing, and gaps open where two of them meet. Strips of triangles upright on each border edge prevent it.
    """
    import fast_simplification

    everything, all_faces = _with_strips(mesh.vertices, mesh.faces)
    if len(all_faces) < _FEWEST:
        return mesh
    scale = _LAST_COST_M / tolerance
    points, left, collapses = fast_simplification.simplify(  # pyright: ignore[reportAssignmentType]  (always three)
        everything * scale, all_faces.astype(np.int32), target_count=4, agg=_EXACT, return_collapses=True)
    replaced_by = _replacements(len(everything), collapses)
    corners = _whole(replaced_by[all_faces])
    used = np.unique(corners)
    if len(used) != len(points) or len(corners) != len(left):
        raise ReductionError("its reduction is inconsistent")
    moved = mesh.vertices.copy()
    moved = np.concatenate([moved, everything[len(moved):]])
    moved[used] = points / scale
    return _replaced(mesh, moved, replaced_by[:len(mesh.vertices)])


def _thinned(mesh):
    """At most :data:`MOST` triangles, by merging vertices on a grid, as for thousands of loose triangles."""
    vertices, faces = thin_out(mesh.vertices, mesh.faces, MOST)
    faces = faces[_twice_areas(vertices, faces) > 0.0]
    nearest = np.zeros(len(mesh.vertices), dtype=int)
    size = max(float(np.ptp(mesh.vertices, axis=0).max()), 1e-30)
    # The nearest vertex that is left, found by a grid: exact enough for the distance.
    cells = np.round(vertices / size * 64.0).astype(int) @ np.array([1, 1 << 20, 1 << 40])
    order = np.argsort(cells)
    wanted = np.round(mesh.vertices / size * 64.0).astype(int) @ np.array([1, 1 << 20, 1 << 40])
    nearest = order[np.minimum(np.searchsorted(cells[order], wanted), len(order) - 1)]
    return _Mesh(vertices, faces, corner_normals(vertices, faces), nearest[mesh.of])


def _replaced(mesh, moved, replaced_by):
    """``mesh`` with its vertices ``replaced_by`` (n,) others, which are at ``moved``."""
    uv = None
    if mesh.uv is not None:
        moved, uv = _on_vertices(mesh, moved, replaced_by)
    corners = replaced_by[mesh.faces]
    whole = _is_whole(corners)
    whole[whole] = _twice_areas(moved, corners[whole]) > 0.0
    faces = corners[whole]
    flat = _unit(np.cross(moved[faces[:, 1]] - moved[faces[:, 0]], moved[faces[:, 2]] - moved[faces[:, 0]]))
    weighted = mesh.corner_normals * _twice_areas(mesh.vertices, mesh.faces)[:, None, None]
    normals = _gathered(replaced_by, mesh.faces, weighted, faces, flat)
    return _Mesh(moved, faces, normals, replaced_by[mesh.of], uv)


def _on_vertices(mesh, moved, replaced_by):
    """(positions, uv) with each of the ``moved`` vertices at the nearest one of those that it replaces."""
    away = np.linalg.norm(mesh.vertices - moved[replaced_by], axis=1)
    order = np.lexsort((away, replaced_by))
    left, first = np.unique(replaced_by[order], return_index=True)
    positions, uv = moved.copy(), np.zeros((len(moved), 2))
    positions[left], uv[left] = mesh.vertices[order[first]], mesh.uv[order[first]]
    return positions, uv


def _level(original, mesh):
    """The :class:`ReducedMesh` of ``mesh``, with its distance from ``original``."""
    # A hundredth of a unit is a third of a degree; what is nearly equal need not be drawn twice.
    rows = np.hstack([mesh.vertices[mesh.faces.ravel()], np.round(mesh.corner_normals.reshape(-1, 3), 2),
                      *([] if mesh.uv is None else [mesh.uv[mesh.faces.ravel()]])])
    rows, corner = np.unique(rows.astype(np.float32), axis=0, return_inverse=True)
    return ReducedMesh(rows[:, :3], _unit(rows[:, 3:6].astype(float)).astype(np.float32), corner.reshape(-1, 3),
                       _distance(original, mesh), None if mesh.uv is None else rows[:, 6:])


def _distance(original, mesh):
    """The distance from the surface of ``mesh`` that :data:`COUNTED` of the original's surface keeps; with a picture,
    what :data:`COUNTED_TEXTURED` of it keeps, or how far :data:`COUNTED` of the picture is shifted if that is more.

    Measured at the original's vertices: from the triangles around the vertex that is left of each, on to triangles
    beside the nearest one while these are nearer. The nearest point of the surface may be nearer, never farther. What
    has vanished counts with its distance from where it went. With a picture, measured in the middle of triangles as
    well: all corners of a triangle that has vanished may be left.
    """
    samples = _samples(original)
    left = mesh.of[samples.beside]
    order = np.argsort(mesh.faces.ravel(), kind="stable")
    place, corners = mesh.faces.ravel()[order], mesh.vertices[mesh.faces]
    away = np.linalg.norm(samples.points - mesh.vertices[left], axis=1)
    nearest = np.full(len(away), -1)
    point, around = np.arange(len(away)), left
    while len(point):
        mine, which = _pairs(place, around)
        face = order[which] // 3
        to_face = point_triangle_distances(samples.points[point[mine]], corners[face])
        # The nearest of each point's triangles comes first.
        ranked = np.lexsort((to_face, point[mine]))
        nearer, first = np.unique(point[mine][ranked], return_index=True)
        face, to_face = face[ranked][first], to_face[ranked][first]
        better = to_face < away[nearer] * (1.0 - 1e-6)
        away[nearer[better]], nearest[nearer[better]] = to_face[better], face[better]
        point, around = np.repeat(nearer[better], 3), mesh.faces[face[better]].ravel()
    if mesh.uv is None:
        return _kept_by(COUNTED, away, samples.weights)
    return max(_kept_by(COUNTED_TEXTURED, away, samples.weights),
               _kept_by(COUNTED, _shifts(mesh, samples, left, nearest), samples.weights))


class _Samples(NamedTuple):
    """``points`` (n, 3) of a surface, a vertex ``beside`` each (n,), ``weights`` (n,): the surface around it. With a
    picture: ``uv`` (n, 2), and the length on the surface of a width of the picture, ``scales`` (n,)."""

    points: np.ndarray
    beside: np.ndarray
    weights: np.ndarray
    uv: np.ndarray | None = None
    scales: np.ndarray | None = None


def _samples(mesh):
    vertices, faces = mesh.vertices, mesh.faces
    of_faces = _twice_areas(vertices, faces)
    few = np.arange(0, len(vertices), -(-len(vertices) // _COMPARED))
    of_vertices = np.bincount(faces.ravel(), np.repeat(of_faces, 3), len(vertices))
    if mesh.uv is None:
        return _Samples(vertices[few], few, of_vertices[few])
    some = np.arange(0, len(faces), -(-len(faces) // _COMPARED))
    in_picture = _twice_areas(np.pad(mesh.uv, ((0, 0), (0, 1))), faces)
    of_vertices_there = np.bincount(faces.ravel(), np.repeat(in_picture, 3), len(vertices))
    on_surface, in_picture = (np.concatenate([at_vertices[few], 3.0 * at_faces[some]]) for at_vertices, at_faces in (
        (of_vertices, of_faces), (of_vertices_there, in_picture)))
    corners = faces[some]
    return _Samples(np.concatenate([vertices[few], vertices[corners].mean(axis=1)]),
                    np.concatenate([few, corners[:, 0]]), on_surface,
                    np.concatenate([mesh.uv[few], mesh.uv[corners].mean(axis=1)]),
                    np.sqrt(on_surface / np.maximum(in_picture, _MIN_IN_PICTURE)))


def _kept_by(share, values, weights):
    """The value that this share of the surface does not exceed: ``values`` (n,) with ``weights`` (n,)."""
    ranked = np.argsort(values)
    covered = np.cumsum(weights[ranked])
    return float(values[ranked[min(np.searchsorted(covered, share * covered[-1]), len(ranked) - 1)]])


def _shifts(mesh, samples, left, nearest):
    """How far the picture of ``mesh`` is shifted at ``samples`` (n,), in the unit of the vertices. ``left`` (n,): the
    vertex that is left at each of them; ``nearest`` (n,): its face of ``mesh``, -1 for that vertex."""
    uv = mesh.uv[left]
    on_face = nearest >= 0
    corners = mesh.faces[nearest[on_face]]
    weights = _weights(samples.points[on_face], mesh.vertices[corners])
    uv[on_face] = np.einsum("ij,ijk->ik", weights, mesh.uv[corners])
    return np.linalg.norm(uv - samples.uv, axis=1) * samples.scales


def _weights(points, triangles):
    """The weights (n, 3) of the corners of ``triangles`` (n, 3, 3) at about the nearest point to ``points`` (n, 3)."""
    a, b, c = (triangles[:, k] for k in range(3))
    across = np.cross(b - a, c - a)
    squared = np.maximum(np.einsum("ij,ij->i", across, across), 1e-60)
    to_b, to_c = (np.einsum("ij,ij->i", np.cross(*pair), across) / squared
                  for pair in ((points - a, c - a), (b - a, points - a)))
    weights = np.clip(np.stack([1.0 - to_b - to_c, to_b, to_c], axis=1), 0.0, None)
    return weights / np.maximum(weights.sum(axis=1), 1e-30)[:, None]


def _pairs(ordered, wanted):
    """All pairs (a, b) of places with ``wanted[a] == ordered[b]``, as two arrays; ``ordered`` is sorted."""
    start, end = np.searchsorted(ordered, wanted, "left"), np.searchsorted(ordered, wanted, "right")
    count = end - start
    return (np.repeat(np.arange(len(wanted)), count),
            np.arange(count.sum()) + np.repeat(start - np.cumsum(count) + count, count))


def point_triangle_distances(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Return the distance (n,) of each of ``points`` (n, 3) from its triangle of ``triangles`` (n, 3, 3)."""
    a, b, c = (triangles[:, k] for k in range(3))
    across = np.cross(b - a, c - a)
    squared = np.maximum(np.einsum("ij,ij->i", across, across), 1e-60)
    inside = np.ones(len(points), dtype=bool)
    nearest = np.full(len(points), np.inf)
    for start, end in ((a, b), (b, c), (c, a)):
        edge, to_point = end - start, points - start
        inside &= np.einsum("ij,ij->i", np.cross(edge, to_point), across) >= 0.0
        along = np.einsum("ij,ij->i", edge, to_point) / np.maximum(np.einsum("ij,ij->i", edge, edge), 1e-60)
        nearest = np.minimum(nearest, np.linalg.norm(to_point - np.clip(along, 0.0, 1.0)[:, None] * edge, axis=1))
    above = np.abs(np.einsum("ij,ij->i", points - a, across)) / np.sqrt(squared)
    return np.where(inside, np.minimum(above, nearest), nearest)


def _with_strips(vertices, faces):
    """The mesh with a strip of triangles upright on each edge that has one triangle only, and one below it: with both,
    borders are twice as dear as surfaces, and parts of different colours show no cracks between them. Its own faces
    come first."""
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    low, high = edges.min(axis=1), edges.max(axis=1)
    _, which, count = np.unique(low * len(vertices) + high, return_inverse=True, return_counts=True)
    open_edges = count[which] == 1
    border, face = edges[open_edges], np.tile(np.arange(len(faces)), 3)[open_edges]
    if not len(border):
        return vertices, faces
    corners = vertices[faces[face]]
    upright = _unit(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    ends, end = np.unique(border, return_inverse=True)
    end = end.reshape(border.shape)
    directions = np.zeros((len(ends), 3))
    for column in end.T:
        np.add.at(directions, column, upright)
    upwards = _STRIP * np.ptp(vertices, axis=0).max() * _unit(directions)
    strips = []
    for number in range(2):
        other = len(vertices) + number * len(ends) + end
        strips += [np.stack([border[:, 1], border[:, 0], other[:, 0]], axis=1),
                   np.stack([border[:, 1], other[:, 0], other[:, 1]], axis=1)]
    return (np.concatenate([vertices, vertices[ends] + upwards, vertices[ends] - upwards]),
            np.concatenate([faces, *strips]))


def _replacements(count, collapses):
    """For each of ``count`` vertices the one that is left of it, after ``collapses`` (n, 2) of the second vertex of a
    row into the first."""
    left = np.arange(count)
    left[collapses[:, 1]] = collapses[:, 0]
    while True:
        further = left[left]
        if np.array_equal(further, left):
            return left
        left = further


def _is_whole(faces):
    """Which faces have three different corners."""
    return (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 0] != faces[:, 2])


def _whole(faces):
    return faces[_is_whole(faces)]


def _unit(vectors):
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1), 1e-30)[..., None]


def _twice_areas(vertices, faces):
    corners = vertices[faces]
    return np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)


def _welded(vertices, faces, size, uv=None):
    """(vertices, faces, numbers of these vertices in ``vertices``) of the mesh with equal vertices merged, with ``uv``
    (n, 2) those that are equal there as well; triangles that lose a corner, and repeated ones, are left out."""
    first, of = _same(vertices, size, uv)
    faces = _whole(of[faces])
    _, once = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)
    return vertices[first], faces[np.sort(once)], first


def _same(vertices, size, uv=None):
    """(the first one of each group of equal vertices, the number of its group for each vertex)."""
    rows = np.round(vertices / (_WELD * max(size, 1e-9))).astype(np.int64)
    if uv is not None:
        rows = np.hstack([rows, np.round(uv / _SAME_UV).astype(np.int64)])
    _, first, of = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    return first, of.reshape(-1)
