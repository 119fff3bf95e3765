# SPDX-License-Identifier: BSD-3-Clause
"""Mesh files as triangles, read in a process with limits: libraries for formats do what a file tells them to."""
import os
import tempfile
import threading

import numpy as np

from bullet_sim.limited import MESHES, LimitError
from bullet_sim.mesh_loading import MeshError, load_scene
from motion_planning.errors import PlanningError
from motion_planning.shapes import TriangleMesh


class MeshUnreadable(PlanningError):
    """A mesh file cannot be used; the text names it and says why."""


class MeshReader:
    """Function from a file's name to its TriangleMesh, in the file's own scale, in m, z up. Each is read once.

    find: function from a name as descriptions have it (package://, file://, path) to a path, or None.
    """

    def __init__(self, find):
        self._find = find
        self._lock = threading.Lock()
        self._known = {}

    def __call__(self, filename):
        """Return the TriangleMesh. Raises MeshUnreadable."""
        with self._lock:
            if filename not in self._known:
                self._known[filename] = self._read(filename)
            return self._known[filename]

    def _read(self, filename):
        path = self._find(filename)
        if path is None:
            raise MeshUnreadable("mesh %s is not there" % filename)
        handle, target = tempfile.mkstemp(prefix="motion_planning_", suffix=".npz")
        os.close(handle)
        try:
            MESHES.call(write_triangles, str(path), target)
            with np.load(target) as arrays:
                return TriangleMesh(arrays["vertices"], arrays["triangles"])
        except (LimitError, ValueError) as error:
            raise MeshUnreadable("mesh %s cannot be used: %s" % (filename, error)) from None
        finally:
            os.unlink(target)


def write_triangles(path, target):
    """Write the triangles of the mesh at ``path`` to the npz file ``target``: vertices (n, 3), triangles (m, 3).

    Raises MeshError, OSError, and what libraries raise.
    """
    scene = load_scene(path)
    mesh = scene.to_geometry() if hasattr(scene, "to_geometry") else scene.dump(concatenate=True)
    triangles = np.asarray(getattr(mesh, "faces", ()))
    if not len(triangles):
        raise MeshError("it holds no triangles")
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    np.savez(target, vertices=np.asarray(mesh.vertices, dtype=float), triangles=np.asarray(mesh.faces, dtype=np.int64))
