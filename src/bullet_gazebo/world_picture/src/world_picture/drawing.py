# SPDX-License-Identifier: BSD-3-Clause
"""Meshes simplified for software rendering: split by colour, in two levels of detail, cached on disk. ROS-free."""
import hashlib
import json
import os
import shutil
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np

from bullet_sim.limited import MESHES, LimitError
from bullet_sim.mesh_loading import MOST_BYTES, load_scene
from bullet_sim.thinning import thin_out
from urdf_model import read_file

#: Triangles that a mesh of :data:`USUAL_M` [m, its longest side] keeps; a robot of thirty links then takes about 15 ms
#: to draw without a graphics card. Larger meshes keep more and smaller ones fewer, within bounds: a finger covers few
#: pixels.
TRIANGLES = 800
USUAL_M = 0.35
_LEAST, _MOST = 0.5, 2.5
#: How far a surface of the fine level, for links that are large in the picture, may be from the original [m], and at
#: most which share of the mesh's size. Three times as many triangles as of the coarse level are left of Baxter.
TOLERANCE_M = 0.01
_TOLERANCE_SHARE = 0.03
#: Most triangles of one colour of the fine level; beyond, the tolerance grows.
MOST = 40_000
_COARSER, _TRIES = 4.0, 3
# A mesh with more triangles is first merged on a grid: the reduction would take too long.
_MANY = 300_000
# Vertices within this share of a mesh's size are one: files often have a vertex for each corner of each triangle.
_WELD = 1e-5
# Reduction by quadric error tears loose sheets: it counts only if the surface keeps its area within this share.
_AREA_KEPT = 0.06
# It also stops early at seams; more triangles than this times the target are too many.
_OVER_TARGET = 1.7
# fast_simplification's threshold grows by this power: 7 is quick and coarse, 1 exact and often short of the target.
_AGGRESSIVENESS = 3
# fast_simplification ends where a collapse costs more than 1e-9 * 103 ** aggressiveness. For exponent 1, and the square
# of a distance as cost, that is the square of 0.32 mm.
_EXACT = 1
_LAST_COST_M = (1e-9 * 103.0) ** 0.5
# Meshes of fewer triangles stay as they are.
_FEWEST = 24
# Width of the strips that hold borders, as a share of the mesh's size.
_STRIP = 0.02
# Brightness of Collada meshes that name no material: the one of assimp, by which rviz shows them.
_PLAIN = (0.6, 0.6, 0.6, 1.0)
# Part of the names of cached files: increase it when the result for the same mesh changes.
_VERSION = 7


class MeshPart(NamedTuple):
    """One colour of a mesh: a Wavefront file in metres; red, green, blue, alpha from 0 to 1, or None for no colour; the
    file of its fine level, for :func:`read_fine`."""

    path: str
    colour: tuple
    fine: str


def read_fine(path):
    """(vertices (n, 3) [m], faces (m, 3)) of the fine level of a :class:`MeshPart`."""
    with np.load(path) as stored:
        return stored["vertices"], stored["faces"]


class DrawingError(Exception):
    """A mesh cannot be read."""


class DrawingCache:
    """Decimated meshes on disk, under a hash of the original's content."""

    def __init__(self, folder=None, triangles=TRIANGLES):
        """``folder``: default ``$XDG_CACHE_HOME/bullet_gazebo/drawings``."""
        base = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
        self._folder = Path(folder or os.path.join(base, "bullet_gazebo", "drawings"))
        self._triangles = triangles

    def parts(self, path):
        """The list of :class:`MeshPart` of the mesh file at ``path``; raises :class:`DrawingError`."""
        try:
            content = read_file(path, MOST_BYTES)
        except OSError as error:
            raise DrawingError("mesh %s cannot be read: %s" % (path, error.strerror)) from error
        key = "%s-%d-%d" % (hashlib.sha256(content).hexdigest()[:32], self._triangles, _VERSION)
        del content
        index = self._folder / key / "parts.json"
        if not index.exists():
            index = self._make(path, key)
        listed = json.loads(index.read_text(encoding="utf-8"))
        return [MeshPart(str(index.parent / name), tuple(colour) if colour else None, str(index.parent / fine))
                for name, colour, fine in listed]

    def _make(self, path, key):
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
        except OSError:
            self._folder = Path(tempfile.mkdtemp(prefix="bullet_gazebo_drawings_"))
        draft = Path(tempfile.mkdtemp(dir=self._folder))
        try:
            MESHES.call(write_parts, str(path), str(draft), self._triangles)
        except LimitError as error:
            shutil.rmtree(draft, ignore_errors=True)
            raise DrawingError("mesh %s cannot be used: %s" % (path, error)) from None
        target = self._folder / key
        try:
            draft.rename(target)
        except OSError:
            target = draft if not (target / "parts.json").exists() else target  # another process has made it
        return target / "parts.json"


def write_parts(path, folder, triangles):
    """Write the mesh at ``path`` into ``folder``, reduced: ``parts.json`` and the files that it lists.

    ``triangles``: the number that a mesh of :data:`USUAL_M` keeps in the coarse level.
    """
    pieces = _read(path)
    total = sum(len(faces) for _, faces, _ in pieces)
    size = float(np.ptp(np.concatenate([vertices for vertices, _, _ in pieces]), axis=0).max())
    kept = triangles * min(max(size / USUAL_M, _LEAST), _MOST)
    listed = []
    for number, (vertices, faces, colour) in enumerate(pieces):
        share = kept * len(faces) / total
        coarse = reduced(vertices, faces, max(20, round(share)))
        if len(coarse[1]):
            name, fine = "part%d.obj" % number, "part%d.npz" % number
            (Path(folder) / name).write_text(_wavefront(*coarse), encoding="ascii")
            vertices, faces = within(vertices, faces, min(TOLERANCE_M, _TOLERANCE_SHARE * size), MOST)
            np.savez(Path(folder) / fine, vertices=vertices.astype(np.float32), faces=faces.astype(np.int32))
            listed.append((name, colour, fine))
    (Path(folder) / "parts.json").write_text(json.dumps(listed), encoding="utf-8")


def reduced(vertices, faces, target):
    """(vertices, faces) with about the same surface as vertices (n, 3) and faces (m, 3) and about ``target`` triangles.

    Edges are collapsed in the order of their quadric error (Garland and Heckbert, "Surface simplification using quadric
    error metrics", 1997): flat parts become large triangles and outlines stay. Where that loses surface, as with loose
    sheets and many small parts, vertices are merged on a grid instead (`bullet_sim.thinning`).
    """
    import fast_simplification

    welded, joined = _welded(vertices, faces)
    if len(joined) <= target:
        return welded, joined
    smooth = fast_simplification.simplify(welded.astype(np.float32), joined.astype(np.int32), target_count=int(target),
                                          agg=_AGGRESSIVENESS)
    merged = thin_out(vertices, faces, target)
    lost, lost_by_merging = (abs(1.0 - _area(*mesh) / max(_area(vertices, faces), 1e-12)) for mesh in (smooth, merged))
    if len(smooth[1]) <= _OVER_TARGET * target and (lost < _AREA_KEPT or lost < lost_by_merging):
        return smooth
    return merged


def within(vertices, faces, tolerance_m, most):
    """(vertices, faces) of at most ``most`` triangles, with the surface of vertices (n, 3) [m] and faces (m, 3) within
    about ``tolerance_m``. No surface is lost; outlines and borders stay.

    The tolerance grows where it leaves too many triangles. Where even that does not help, as with thousands of loose
    triangles, vertices are merged on a grid (`bullet_sim.thinning`).
    """
    welded, joined = _welded(vertices, faces)
    if len(joined) > _MANY:
        welded, joined = _welded(*thin_out(welded, joined, _MANY))
    for _ in range(_TRIES):
        found = _collapsed(welded, joined, tolerance_m)
        if len(found[1]) <= most:
            return found
        tolerance_m *= _COARSER
    return thin_out(welded, joined, most)


def _collapsed(vertices, faces, tolerance_m):
    """The mesh without the edges whose collapse costs less than the tolerance.

    The error of a flat sheet does not change when its border moves inwards: without more, sheets would shrink to
    nothing, and gaps open where two of them meet. A strip of triangles upright on each border edge prevents it.
    """
    import fast_simplification

    everything, all_faces = _with_strips(vertices, faces)
    if len(all_faces) < _FEWEST:
        return vertices, faces
    scale = _LAST_COST_M / tolerance_m
    points, left, collapses = fast_simplification.simplify(
        everything * scale, all_faces.astype(np.int32), target_count=4, agg=_EXACT, return_collapses=True)
    replaced_by = _replacements(len(everything), collapses)
    corners = _whole(replaced_by[all_faces])
    used = np.unique(corners)
    if len(used) != len(points) or len(corners) != len(left):
        raise DrawingError("its reduction is inconsistent")
    number = np.zeros(len(everything), dtype=np.int64)
    number[used] = np.arange(len(used))
    return _without_unused(points / scale, number[_whole(replaced_by[faces])])


def _with_strips(vertices, faces):
    """The mesh with a strip of triangles upright on each edge that has one triangle only. Its own faces come first."""
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
    added = vertices[ends] + _STRIP * np.ptp(vertices, axis=0).max() * _unit(directions)
    above = len(vertices) + end
    strips = np.concatenate([np.stack([border[:, 1], border[:, 0], above[:, 0]], axis=1),
                             np.stack([border[:, 1], above[:, 0], above[:, 1]], axis=1)])
    return np.concatenate([vertices, added]), np.concatenate([faces, strips])


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


def _whole(faces):
    """The faces with three different corners."""
    return faces[(faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 0] != faces[:, 2])]


def _without_unused(vertices, faces):
    used, corner = np.unique(faces, return_inverse=True)
    return vertices[used], corner.reshape(-1, 3)


def _unit(vectors):
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1), 1e-30)[:, None]


def _welded(vertices, faces):
    """The mesh with equal vertices merged; triangles that lose a corner, and repeated ones, are left out."""
    size = max(float(np.ptp(vertices, axis=0).max()), 1e-9)
    _, first, of = np.unique(np.round(vertices / (_WELD * size)).astype(np.int64), axis=0, return_index=True,
                             return_inverse=True)
    faces = _whole(of.reshape(-1)[faces])
    _, once = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)
    return vertices[first], faces[np.sort(once)]


def _area(vertices, faces):
    corners = vertices[faces]
    return 0.5 * float(np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]),
                                      axis=1).sum())


def _read(path):
    """The mesh as [(vertices (n, 3), faces (m, 3), rgba or None)], one for each colour."""
    import trimesh

    collada = str(path).lower().endswith(".dae")
    gamma, plain = (1.0 / 2.2, _PLAIN) if collada else (1.0, None)
    scene = load_scene(path)
    pieces = {}
    for node in scene.graph.nodes_geometry:
        transform, name = scene.graph[node]
        mesh = scene.geometry[name]
        if len(getattr(mesh, "faces", ())) == 0:
            continue
        vertices = trimesh.transform_points(mesh.vertices, transform)
        pieces.setdefault(_colour(mesh, gamma) or plain, []).append((vertices, np.asarray(mesh.faces)))
    if not pieces:
        raise DrawingError("it holds no triangles")
    joined = []
    for colour, meshes in pieces.items():
        starts = np.cumsum([0] + [len(vertices) for vertices, _ in meshes[:-1]])
        shifted = [faces + start for (_, faces), start in zip(meshes, starts, strict=True)]
        joined.append((np.concatenate([vertices for vertices, _ in meshes]), np.concatenate(shifted), colour))
    return joined


def _colour(mesh, gamma):
    material = getattr(mesh.visual, "material", None)
    colour = getattr(material, "main_color", None)
    if colour is None and getattr(mesh.visual, "kind", None) in ("face", "vertex"):
        colour = mesh.visual.main_color
    if colour is None:
        return None
    # Modelling programs write COLLADA colours as linear light; screens want them with gamma. The fourth number is
    # ignored: for some exporters it means opacity, for others transparency.
    return (*(round((int(value) / 255.0) ** gamma, 3) for value in colour[:3]), 1.0)


def _wavefront(vertices, faces):
    lines = ["v %.6g %.6g %.6g" % tuple(vertex) for vertex in vertices]
    lines += ["f %d %d %d" % tuple(face) for face in faces + 1]
    return "\n".join(lines) + "\n"
