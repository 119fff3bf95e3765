# SPDX-License-Identifier: BSD-3-Clause
"""Meshes simplified for software rendering: split by colour, in levels of detail, cached on disk. ROS-free."""
from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from bullet_sim.limited_process import LimitedProcess, LimitError
from bullet_sim.mesh_loading import MAX_BYTES, MAX_BYTES_BESIDE, WHOLE
from disk_cache.files import DRAFT, remove_drafts, spare_folder, try_room
from urdf_model import read_file
from world_picture import reduction
from world_picture.pieces import read_pieces
from world_picture.results import cache_folder, existing, open_to_all
from world_picture.textures import Texture, save_reduced, write_texture

#: Where one level must do: the coarsest whose distance from the original is at most this share of the mesh's size.
PLAIN = 0.01
# Limits of the process that simplifies: a mesh of 200,000 triangles takes some seconds, and longer on a busy machine.
_PROCESSOR_S, _WAITING_S = 15, 240.0
LIMITS = {"processor_s": _PROCESSOR_S, "waiting_s": _WAITING_S}
_PROCESS = LimitedProcess(**LIMITS)
# Part of the names of cached files: increase it when the result for the same mesh changes.
_VERSION = 13
_FOLDER = "drawings"
# Names of folders that are being written begin so; nothing is written to one that is older than this [s].
_ABANDONED_S = 3600.0
# Room that a mesh's levels and its picture may need [bytes].
_ROOM = 8_000_000
# The files with the materials of a Wavefront file.
_MATERIALS = re.compile(rb"^mtllib[ \t]+(\S.*?)[ \t]*\r?$", re.MULTILINE)


class LevelFile(NamedTuple):
    """A level of detail, for :func:`read_level`; its distance from the original in the mesh's unit, as
    :class:`world_picture.reduction.ReducedMesh` has it."""

    path: str
    error: float


class MeshPart(NamedTuple):
    """One look of a mesh: its ``levels``, the finest first; the number of the ``plain`` one, and the same as a
    Wavefront file, in metres; colour, emission and texture as :class:`world_picture.pieces.Piece` has them, but for
    pictures inside of the mesh file: of these, ``texture`` is a path."""

    path: str
    colour: tuple[float, ...] | None
    levels: tuple[LevelFile, ...]
    plain: int
    emission: tuple[float, ...] = (0.0, 0.0, 0.0)
    texture: str = ""


def read_level(path: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(vertices (n, 3), unit normals (n, 3), faces (m, 3)) of the file of a :class:`LevelFile`."""
    with np.load(path) as stored:
        return stored["vertices"], stored["normals"], stored["faces"]


def read_uv(path: str) -> np.ndarray | None:
    """The vertices' places (n, 2) in a picture, as :class:`world_picture.pieces.Piece` has them, of the file of a
    :class:`LevelFile`; None if it has none."""
    with np.load(path) as stored:
        return stored["uv"] if "uv" in stored else None


class DrawingError(Exception):
    """A mesh or a picture cannot be read."""


class DrawingCache:
    """Simplified meshes and reduced pictures on disk, under a hash of the original's content. Where the folder cannot
    be written, or its disk is full, in a folder for temporary files."""

    def __init__(self, folder: str | os.PathLike[str] | None = None, process: LimitedProcess | None = None) -> None:
        """``folder``: default ``$XDG_CACHE_HOME/bullet_gazebo/drawings``; ``process``: a
        ``bullet_sim.limited_process.LimitedProcess``, by default one for all caches of this program."""
        self._process = process
        self._folder = Path(folder or cache_folder(_FOLDER))

    def begin_scene(self) -> None:
        """A viewer begins to ask for the meshes of a scene."""

    def is_making(self, keys: Iterable[str]) -> bool:
        """Whether one of ``keys`` is still being simplified: never, where :meth:`parts` waits for it."""
        return False

    def parts(self, path: str | os.PathLike[str], textured: bool = False,
              part: tuple[str, bool] = WHOLE) -> list[MeshPart]:
        """The list of :class:`MeshPart` of the mesh file at ``path``; raises :class:`DrawingError`. ``textured``: for a
        picture that is not the file's own; all levels have ``uv``, if the file has. ``part``: as for
        ``bullet_sim.mesh_loading.load_scene``."""
        kind = "-textured" if textured else ""
        if part != WHOLE:
            kind += "-part-" + hashlib.sha256(repr(part).encode()).hexdigest()[:16]
        index = self._index("mesh", path, "parts.json", kind, write_parts, textured, part)
        listed = json.loads(index.read_text(encoding="utf-8"))
        return [MeshPart(str(index.parent / name), tuple(colour) if colour else None,
                         tuple(LevelFile(str(index.parent / level), error) for level, error in levels), plain,
                         tuple(emission), str(index.parent / own_picture) if own_picture else texture)
                for name, colour, levels, plain, emission, texture, own_picture in listed]

    def texture(self, path: str | os.PathLike[str]) -> Texture:
        """The :class:`world_picture.textures.Texture` of the picture file at ``path``; raises
        :class:`DrawingError`."""
        index = self._index("picture", path, "picture.json", "-picture", write_texture)
        return Texture(str(index.parent / "picture.png"), tuple(json.loads(index.read_text(encoding="utf-8"))))

    def _index(self, what, path, name, kind, write, *arguments):
        """The path of the file ``name`` that ``write(path, folder, *arguments)`` makes of the file at ``path``."""
        try:
            content = read_file(path, MAX_BYTES)
        except OSError as error:
            raise DrawingError("%s %s cannot be read: %s" % (what, path, error.strerror)) from error
        key = "%s-%d%s" % (_digest(path, content), _VERSION, kind)
        del content
        index = existing(self._folder, Path(key) / name, _FOLDER)
        if index is None:
            try:
                index = self._make(key, name, write, str(path), *arguments)
            except LimitError as error:
                raise DrawingError("%s %s cannot be used: %s" % (what, path, error)) from None
        return index

    def _make(self, key, name, write, path, *arguments):
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            try_room(self._folder, _ROOM)
        except OSError:
            self._folder = spare_folder("bullet_gazebo_drawings")
            if (self._folder / key / name).exists():
                return self._folder / key / name
        remove_drafts(self._folder, _ABANDONED_S)
        draft = Path(tempfile.mkdtemp(prefix=DRAFT, dir=self._folder))
        try:
            (self._process or _PROCESS).call(write, path, str(draft), *arguments)
        except LimitError:
            shutil.rmtree(draft, ignore_errors=True)
            raise
        open_to_all(draft)
        target = self._folder / key
        try:
            draft.rename(target)
        except OSError:
            if not (target / name).exists():
                return draft / name
            shutil.rmtree(draft, ignore_errors=True)  # another process has made it
        return target / name


def _digest(path, content):
    """The hash of a file's content; of a Wavefront file with the materials that it names, which have its colours."""
    digest = hashlib.sha256(content)
    if str(path).lower().endswith(".obj"):
        for name in _MATERIALS.findall(content):
            try:
                digest.update(read_file(Path(path).parent / os.fsdecode(name), MAX_BYTES_BESIDE))
            except (OSError, ValueError):  # the mesh is drawn without; a name may hold a zero byte
                continue
    return digest.hexdigest()[:32]


def write_parts(path: str, folder: str, textured: bool, part: tuple[str, bool] = WHOLE) -> None:
    """Write the mesh at ``path`` into ``folder``, in levels of detail: ``parts.json`` and the files that it lists.
    ``textured``: whether all levels have ``uv``, if the file has, or only those with a picture; ``part``: as for
    ``load_scene``."""
    pieces, target = read_pieces(path, part, textured), Path(folder)
    size = float(np.ptp(np.concatenate([piece.vertices for piece in pieces]), axis=0).max())
    listed = []
    for number, piece in enumerate(pieces):
        levels, files = reduction.levels(piece.vertices, piece.faces, size, piece.uv), []
        for step, level in enumerate(levels):
            files.append(("part%d_%d.npz" % (number, step), level.error))
            arrays = {} if level.uv is None else {"uv": level.uv}
            np.savez(target / files[-1][0], vertices=level.vertices, normals=level.normals,
                     faces=level.faces.astype(np.int32), **arrays)
        if levels:
            plain = max(step for step, level in enumerate(levels) if level.error <= PLAIN * size or step == 0)
            name = "part%d.obj" % number
            (target / name).write_text(_wavefront(levels[plain]), encoding="ascii")
            own_picture = ""
            if piece.picture is not None:
                own_picture = "picture%s.png" % piece.texture
                save_reduced(piece.picture, target / own_picture)
            listed.append((name, piece.colour, files, plain, piece.emission, piece.texture, own_picture))
    (target / "parts.json").write_text(json.dumps(listed), encoding="utf-8")


def _wavefront(level):
    lines = ["v %.6g %.6g %.6g" % tuple(vertex) for vertex in level.vertices]
    lines += ["vn %.3g %.3g %.3g" % tuple(normal) for normal in level.normals]
    lines += ["f %d//%d %d//%d %d//%d" % tuple(np.repeat(face, 2)) for face in level.faces + 1]
    return "\n".join(lines) + "\n"
