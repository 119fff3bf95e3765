# SPDX-License-Identifier: BSD-3-Clause
"""Meshes simplified for software rendering: split by colour, decimated, cached on disk. ROS-free."""
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
# Part of the names of cached files: increase it when the result for the same mesh changes.
_VERSION = 4


class MeshPart(NamedTuple):
    """One colour of a mesh: a Wavefront file in metres; red, green, blue, alpha from 0 to 1, or None for no colour."""

    path: str
    colour: tuple


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
        return [MeshPart(str(index.parent / name), tuple(colour) if colour else None) for name, colour in listed]

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
        vertices, faces = thin_out(vertices, faces, max(20, round(kept * len(faces) / total)))
        if len(faces):
            name = "part%d.obj" % number
            (Path(folder) / name).write_text(_wavefront(vertices, faces), encoding="ascii")
            listed.append((name, colour))
    (Path(folder) / "parts.json").write_text(json.dumps(listed), encoding="utf-8")


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
