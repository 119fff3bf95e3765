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
#: As many times more triangles has the fine level, for links that are large in the picture.
FINE = 3.0
# Vertices within this share of a mesh's size are one: files often have a vertex for each corner of each triangle.
_WELD = 1e-5
# Reduction by quadric error tears loose sheets: it counts only if the surface keeps its area within this share.
_AREA_KEPT = 0.06
# It also stops early at seams; more triangles than this times the target are too many.
_OVER_TARGET = 1.7
# fast_simplification's threshold grows by this power: 7 is quick and coarse, 1 exact and often short of the target.
_AGGRESSIVENESS = 3
# Part of the names of cached files: increase it when the result for the same mesh changes.
_VERSION = 5


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
    """Write the mesh at ``path`` into ``folder``, decimated: ``parts.json`` and the files that it lists.

    ``triangles``: the number that a mesh of :data:`USUAL_M` keeps.
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
            vertices, faces = reduced(vertices, faces, max(20, round(FINE * share)))
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


def _welded(vertices, faces):
    """The mesh with equal vertices merged; triangles that lose a corner, and repeated ones, are left out."""
    size = max(float(np.ptp(vertices, axis=0).max()), 1e-9)
    _, first, of = np.unique(np.round(vertices / (_WELD * size)).astype(np.int64), axis=0, return_index=True,
                             return_inverse=True)
    faces = of.reshape(-1)[faces]
    faces = faces[(faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 0] != faces[:, 2])]
    _, once = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)
    return vertices[first], faces[np.sort(once)]


def _area(vertices, faces):
    corners = vertices[faces]
    return 0.5 * float(np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]),
                                      axis=1).sum())


def _read(path):
    """The mesh as [(vertices (n, 3), faces (m, 3), rgba or None)], one for each colour."""
    import trimesh

    gamma = 1.0 / 2.2 if str(path).lower().endswith(".dae") else 1.0
    scene = load_scene(path)
    pieces = {}
    for node in scene.graph.nodes_geometry:
        transform, name = scene.graph[node]
        mesh = scene.geometry[name]
        if len(getattr(mesh, "faces", ())) == 0:
            continue
        vertices = trimesh.transform_points(mesh.vertices, transform)
        pieces.setdefault(_colour(mesh, gamma), []).append((vertices, np.asarray(mesh.faces)))
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
