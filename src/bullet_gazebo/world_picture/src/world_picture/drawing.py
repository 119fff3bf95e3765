# SPDX-License-Identifier: BSD-3-Clause
"""Meshes simplified for software rendering: split by colour, in levels of detail, cached on disk. ROS-free."""
import hashlib
import json
import os
import shutil
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np

from bullet_sim.limited import LimitedProcess, LimitError
from bullet_sim.mesh_loading import MOST_BYTES, load_scene
from urdf_model import read_file
from world_picture import reduction

#: Where one level must do: the coarsest whose distance from the original is at most this share of the mesh's size.
PLAIN = 0.01
# Brightness of Collada meshes that name no material: the one of assimp, by which rviz shows them.
_PLAIN_COLOUR = (0.6, 0.6, 0.6, 1.0)
# Limits of the process that simplifies: a mesh of 200,000 triangles takes some seconds, and longer on a busy machine.
_PROCESSOR_S, _WAITING_S = 15, 240.0
_PROCESS = LimitedProcess(processor_s=_PROCESSOR_S, waiting_s=_WAITING_S)
# Part of the names of cached files: increase it when the result for the same mesh changes.
_VERSION = 10


class LevelFile(NamedTuple):
    """A level of detail, for :func:`read_level`; its distance from the original in the mesh's unit, as
    :class:`world_picture.reduction.Level` has it."""

    path: str
    error: float


class MeshPart(NamedTuple):
    """One colour of a mesh: its ``levels``, the finest first; the number of the ``plain`` one, and the same as a
    Wavefront file, in metres; red, green, blue, alpha from 0 to 1, or None for no colour."""

    path: str
    colour: tuple
    levels: tuple
    plain: int


def read_level(path):
    """(vertices (n, 3), unit normals (n, 3), faces (m, 3)) of the file of a :class:`LevelFile`."""
    with np.load(path) as stored:
        return stored["vertices"], stored["normals"], stored["faces"]


class DrawingError(Exception):
    """A mesh cannot be read."""


class DrawingCache:
    """Simplified meshes on disk, under a hash of the original's content."""

    def __init__(self, folder=None):
        """``folder``: default ``$XDG_CACHE_HOME/bullet_gazebo/drawings``."""
        base = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
        self._folder = Path(folder or os.path.join(base, "bullet_gazebo", "drawings"))

    def parts(self, path):
        """The list of :class:`MeshPart` of the mesh file at ``path``; raises :class:`DrawingError`."""
        try:
            content = read_file(path, MOST_BYTES)
        except OSError as error:
            raise DrawingError("mesh %s cannot be read: %s" % (path, error.strerror)) from error
        key = "%s-%d" % (hashlib.sha256(content).hexdigest()[:32], _VERSION)
        del content
        index = self._folder / key / "parts.json"
        if not index.exists():
            index = self._make(path, key)
        listed = json.loads(index.read_text(encoding="utf-8"))
        return [MeshPart(str(index.parent / name), tuple(colour) if colour else None,
                         tuple(LevelFile(str(index.parent / level), error) for level, error in levels), plain)
                for name, colour, levels, plain in listed]

    def _make(self, path, key):
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
        except OSError:
            self._folder = Path(tempfile.mkdtemp(prefix="bullet_gazebo_drawings_"))
        draft = Path(tempfile.mkdtemp(dir=self._folder))
        try:
            _PROCESS.call(write_parts, str(path), str(draft))
        except LimitError as error:
            shutil.rmtree(draft, ignore_errors=True)
            raise DrawingError("mesh %s cannot be used: %s" % (path, error)) from None
        target = self._folder / key
        try:
            draft.rename(target)
        except OSError:
            target = draft if not (target / "parts.json").exists() else target  # another process has made it
        return target / "parts.json"


def write_parts(path, folder):
    """Write the mesh at ``path`` into ``folder``, in levels of detail: ``parts.json`` and the files that it lists."""
    pieces, folder = _read(path), Path(folder)
    size = float(np.ptp(np.concatenate([vertices for vertices, _, _ in pieces]), axis=0).max())
    listed = []
    for number, (vertices, faces, colour) in enumerate(pieces):
        levels, files = reduction.levels(vertices, faces, size), []
        for step, level in enumerate(levels):
            files.append(("part%d_%d.npz" % (number, step), level.error))
            np.savez(folder / files[-1][0], vertices=level.vertices, normals=level.normals,
                     faces=level.faces.astype(np.int32))
        if levels:
            plain = max(step for step, level in enumerate(levels) if level.error <= PLAIN * size or step == 0)
            name = "part%d.obj" % number
            (folder / name).write_text(_wavefront(*levels[plain]), encoding="ascii")
            listed.append((name, colour, files, plain))
    (folder / "parts.json").write_text(json.dumps(listed), encoding="utf-8")


def _read(path):
    """The mesh as [(vertices (n, 3), faces (m, 3), rgba or None)], one for each colour."""
    import trimesh

    plain = _PLAIN_COLOUR if str(path).lower().endswith(".dae") else None
    scene = load_scene(path)
    pieces = {}
    for node in scene.graph.nodes_geometry:
        transform, name = scene.graph[node]
        mesh = scene.geometry[name]
        if len(getattr(mesh, "faces", ())) == 0:
            continue
        vertices = trimesh.transform_points(mesh.vertices, transform)
        pieces.setdefault(_colour(mesh) or plain, []).append((vertices, np.asarray(mesh.faces)))
    if not pieces:
        raise DrawingError("it holds no triangles")
    joined = []
    for colour, meshes in pieces.items():
        starts = np.cumsum([0] + [len(vertices) for vertices, _ in meshes[:-1]])
        shifted = [faces + start for (_, faces), start in zip(meshes, starts, strict=True)]
        joined.append((np.concatenate([vertices for vertices, _ in meshes]), np.concatenate(shifted), colour))
    return joined


def _colour(mesh):
    """The diffuse colour that the file names, as rviz and Gazebo show it in full light, or None."""
    material = getattr(mesh.visual, "material", None)
    colour = getattr(material, "main_color", None)
    if colour is None and getattr(mesh.visual, "kind", None) in ("face", "vertex"):
        colour = mesh.visual.main_color
    if colour is None:
        return None
    # The fourth number is ignored: for some exporters it means opacity, for others transparency.
    return (*(round(int(value) / 255.0, 3) for value in colour[:3]), 1.0)


def _wavefront(vertices, normals, faces, _):
    lines = ["v %.6g %.6g %.6g" % tuple(vertex) for vertex in vertices]
    lines += ["vn %.3g %.3g %.3g" % tuple(normal) for normal in normals]
    lines += ["f %d//%d %d//%d %d//%d" % tuple(np.repeat(face, 2)) for face in faces + 1]
    return "\n".join(lines) + "\n"
