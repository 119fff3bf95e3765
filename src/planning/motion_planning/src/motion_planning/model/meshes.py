# SPDX-License-Identifier: BSD-3-Clause
"""Mesh files as triangles, read in a process with limits: libraries for formats do what a file tells them to.

Triangles are kept on disk. Who finds all of them there starts no process, and loads no libraries: 40 MB and a second.
"""
from __future__ import annotations

import contextlib
import hashlib
import os
import tempfile
import threading
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from disk_cache.compiled import folder
from disk_cache.files import draft_of
from motion_planning.errors import PlanningError
from motion_planning.shapes import TriangleMesh


class MeshUnreadable(PlanningError):
    """A mesh file cannot be used; the text names it and the reason."""


class MeshReader:
    """Function from a file's name to its TriangleMesh, in the file's own scale, in m, z up. Each is read once.

    find: function from a name in a description (package://, file://, path) to a path, or None.
    """

    def __init__(self, find: Callable[[str], str | Path | None]) -> None:
        self._find = find
        self._lock = threading.Lock()
        self._known = {}

    def __call__(self, filename: str) -> TriangleMesh:
        """Return the TriangleMesh. Raises MeshUnreadable."""
        with self._lock:
            if filename not in self._known:
                self._known[filename] = self._read(filename)
            return self._known[filename]

    def _read(self, filename: str) -> TriangleMesh:
        path = self._find(filename)
        if path is None:
            raise MeshUnreadable("mesh %s is not there" % filename)
        try:
            kept = _file(Path(path))
            try:
                return _triangles(kept)
            except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
                mesh = _made(path)
                _keep(mesh, kept)
                return mesh
        except (OSError, ValueError) as error:
            raise MeshUnreadable("mesh %s cannot be used: %s" % (filename, error)) from None


def _file(path: Path) -> Path:
    """The file that the triangles of the mesh at ``path`` are kept in: another one for other content."""
    digest = hashlib.sha256(path.suffix.lower().encode())
    # The corners of a glTF file may stand in others beside it.
    for part in [path, *(sorted(path.parent.glob("*.bin")) if path.suffix.lower() == ".gltf" else ())]:
        with part.open("rb") as file:
            digest.update(hashlib.file_digest(file, "sha256").digest())
    return Path(folder("motion_planning_meshes", [__file__])) / (digest.hexdigest()[:32] + ".npz")


def _triangles(file: str | Path) -> TriangleMesh:
    with np.load(file) as arrays:
        return TriangleMesh(arrays["vertices"], arrays["triangles"])


def _made(path: str | Path) -> TriangleMesh:
    """The TriangleMesh of a file, read now. Raises ValueError, OSError."""
    from bullet_sim.limited_process import MESHES, LimitError  # loads PyBullet

    handle, target = tempfile.mkstemp(prefix="motion_planning_", suffix=".npz")
    os.close(handle)
    try:
        MESHES.call(write_triangles, str(path), target)
        return _triangles(target)
    except LimitError as error:
        raise ValueError(error) from None
    finally:
        os.unlink(target)


def _keep(mesh: TriangleMesh, kept: Path) -> None:
    """Write a TriangleMesh into the file ``kept``, unless there is no room."""
    with contextlib.suppress(OSError), draft_of(kept) as draft:
        np.savez(draft, vertices=mesh.vertices, triangles=mesh.triangles)


def write_triangles(path: str, target: str) -> None:
    """Write the triangles of the mesh at ``path`` to the npz file ``target``: vertices (n, 3), triangles (m, 3).

    Raises MeshError, OSError, and the libraries' exceptions.
    """
    from bullet_sim.mesh_loading import MeshError, load_scene

    scene: Any = load_scene(path)
    mesh = scene.to_geometry() if hasattr(scene, "to_geometry") else scene.dump(concatenate=True)
    triangles = np.asarray(getattr(mesh, "faces", ()))
    if not len(triangles):
        raise MeshError("it holds no triangles")
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    np.savez(target, vertices=np.asarray(mesh.vertices, dtype=float), triangles=np.asarray(mesh.faces, dtype=np.int64))
