# SPDX-License-Identifier: BSD-3-Clause
"""Collision shapes, made once and shared: PyBullet leaks a quarter of a megabyte each time that it loads a mesh
again."""

from __future__ import annotations

import contextlib
import hashlib
import locale
import os
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from disk_cache.files import cache_home, draft_of, spare_folder, try_room
from urdf_model import Box, Cylinder, Mesh, Plane, Sphere, check_file, read_file
from urdf_model.transforms import pose_matrix, quaternion_from_matrix

from .errors import LOG, BulletSimError
from .gathered import BulletShape, corners, gathered, without_margin
from .limited_process import MESHES, LimitError
from .mesh_loading import MAX_BYTES, WHOLE, to_wavefront
from .quiet_pybullet import pybullet

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from urdf_model import Shape

NO_SHAPE = -1
# BulletShape of the names of cached files: increase it when the result for the same mesh changes.
_VERSION = b"4"
#: Largest number for one body; with more, making it takes the loop more than 50 ms.
_MAX_SHAPES_OF_BODY = 1000
# Room [bytes] for a mesh as text, with its hull: so many times the file that it is made from, which may be binary,
# between these bounds; larger meshes are thinned out.
_GROWTH, _ROOM = 4, (100_000, 20_000_000)
# A plane that is tilted, or one of several shapes, becomes a slab of this size [m]: Bullet's own plane must be the only
# shape of its body.
_SLAB_M = (200.0, 200.0, 1.0)


class MeshCache:
    """Meshes in any format that trimesh reads, kept on disk as the Wavefront files that PyBullet reads.

    The file name is a hash of the mesh's content, so a changed mesh is converted again and copies share a file. Where
    the folder cannot be written, or its disk is full, files are made in a folder for temporary files.
    """

    def __init__(self, folder: str | Path | None = None, warn: Callable[[str], None] = LOG.warning) -> None:
        """``warn(text)`` is called for meshes that are simplified, and once for a folder that cannot be written."""
        self._warn = warn
        self.folder = Path(folder or cache_home() / "bullet_sim" / "meshes")
        self._known = {}  # (path, size, time of change, planes) -> Wavefront file

    def wavefront(self, path: str | Path, planes: tuple[tuple, ...] = (), hollow: bool = True,
                  part: tuple[str, bool] = WHOLE) -> str:
        """Return the path of a Wavefront copy of the mesh at ``path``, in metres, z up.

        ``planes``: as for ``convex_parts.cut``; given, the copy holds one object for each part. ``hollow``: True to
        keep the triangles; False if the convex hull is enough. ``part``: as for ``mesh_loading.load_scene``. Raises
        BulletSimError when the mesh cannot be read.
        """
        try:
            status = os.stat(path)
            key = (str(path), status.st_size, status.st_mtime_ns, planes, part)
            if key not in self._known or not self._known[key].exists():
                target = self._target(path, planes, part)
                self._known[key] = target if target.exists() else self._convert(path, target.name, planes, part)
        except OSError as error:
            raise BulletSimError("mesh %s cannot be read: %s" % (path, error.strerror)) from None
        hull = self._known[key].with_suffix(".hull.obj")
        return str(hull if not hollow and hull.exists() else self._known[key])

    def corners(self, path: str | Path, planes: tuple[tuple, ...] = (),
                part: tuple[str, bool] = WHOLE) -> np.ndarray | None:
        """The corners (3 m, 3) of the triangles of a copy as :meth:`wavefront` has made it for any world of this user;
        None if there is none yet."""
        try:
            return corners(self._target(path, planes, part))
        except (OSError, ValueError):
            return None

    def _target(self, path: str | Path, planes: tuple[tuple, ...], part: tuple[str, bool]) -> Path:
        asked = (repr(planes) if planes else "") + (repr(part) if part != WHOLE else "")
        content = read_file(path, MAX_BYTES) + asked.encode() + _VERSION
        return self.folder / (hashlib.sha256(content).hexdigest()[:32] + ".obj")

    def keep(self, key: bytes, lines: Callable[[], list[str]]) -> str:
        """Return the path of a file that holds the result of ``lines()``, cached under ``key`` (bytes)."""
        target = self.folder / (hashlib.sha256(key + _VERSION).hexdigest()[:32] + ".obj")
        if not target.exists():
            text = "\n".join(lines()) + "\n"
            target = self._folder_with_room(len(text)) / target.name
            with draft_of(target) as draft:
                draft.write_text(text, encoding="ascii")
        return str(target)

    def _folder_with_room(self, size: int) -> Path:
        """A folder in which a file of ``size`` bytes can be made. Raises BulletSimError where there is none."""
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            try_room(self.folder, size)
            return self.folder
        except OSError as error:
            refusal = "%s: %s" % (self.folder, error.strerror)
        try:
            spare = spare_folder("bullet_sim_meshes")
            try_room(spare, size)
        except OSError as error:
            raise BulletSimError("there is no room for a converted mesh of up to %d kB, neither in %s, nor in %s: %s; "
                                 "delete some files" % (size // 1000, refusal, tempfile.gettempdir(), error.strerror)
                                 ) from None
        self._warn("meshes cannot be kept in %s; they are made in %s. Make room there, or make it yours if it is root's"
                   % (refusal, spare))
        self.folder = spare
        return spare

    def _convert(self, path: str | Path, name: str, planes: tuple[tuple, ...], part: tuple[str, bool]) -> Path:
        target = self._folder_with_room(int(np.clip(_GROWTH * os.stat(path).st_size, *_ROOM))) / name
        if target.exists():
            return target
        with draft_of(target) as copy:
            try:
                remark = MESHES.call(to_wavefront, str(path), str(copy), planes, part)
            except LimitError as error:
                raise BulletSimError("mesh %s cannot be used: %s" % (path, error)) from None
            hull = Path(str(copy) + ".hull")
            if hull.exists():
                os.replace(hull, target.with_suffix(".hull.obj"))
        if remark:
            self._warn("mesh %s: %s" % (path, remark))
        return target


@contextlib.contextmanager
def _points_in_numbers() -> Iterator[None]:
    """Use the C locale while Bullet reads a file: under a locale with decimal commas, its reader of files with several
    objects reads "0.8" as 0."""
    in_force = locale.setlocale(locale.LC_NUMERIC)
    locale.setlocale(locale.LC_NUMERIC, "C")
    try:
        yield
    finally:
        locale.setlocale(locale.LC_NUMERIC, in_force)


def _reason(uri: str) -> str:
    scheme = uri.partition("://")[0].lower()
    if scheme in ("http", "https", "ftp"):
        return ": meshes are not fetched over the network; save it and name the file"
    return ""


class MeshFiles:
    """From a urdf_model.Mesh to files: ``find_mesh(uri)`` -> path or None, and a MeshCache. Any thread may ask."""

    def __init__(self, find_mesh: Callable[[str], str | None], cache: MeshCache | None = None) -> None:
        self._find_mesh = find_mesh
        self._cache = cache or MeshCache()

    def path(self, mesh: Mesh) -> str:
        """Return the path of the file; raises BulletSimError if it does not exist, or is no file that is read."""
        path = self._find_mesh(mesh.filename)
        if path is None:
            raise BulletSimError("mesh %s cannot be found%s" % (mesh.filename, _reason(mesh.filename)))
        try:
            check_file(path, MAX_BYTES)
        except OSError as error:
            raise BulletSimError("mesh %s cannot be used: %s" % (mesh.filename, error.strerror)) from None
        return path

    def wavefront(self, mesh: Mesh, planes: tuple[tuple, ...] = (), hollow: bool = True) -> str:
        """Return the file to collide with; raises BulletSimError when the mesh cannot be found or read.

        ``planes``, ``hollow``: as for MeshCache.
        """
        return self._cache.wavefront(self.path(mesh), planes, hollow, (mesh.submesh, mesh.centred))

    def parts(self, shapes: Sequence[Shape], concave: bool,
              mesh_cuts: dict[str, tuple[tuple, ...]] | None = None) -> list[BulletShape]:
        """Return what PyBullet makes of ``shapes`` (urdf_model.Shape): a list of at most ``gathered.MAX_SHAPES``
        BulletShape.

        ``concave``, ``mesh_cuts``: as for ``ShapeStore.compound``. Raises BulletSimError for too many shapes, and for a
        mesh that cannot be found or read.
        """
        if len(shapes) > _MAX_SHAPES_OF_BODY:
            raise BulletSimError("link '%s', with what is fixed to it, has %d collision shapes; expected at most %d"
                                 % (shapes[0].link, len(shapes), _MAX_SHAPES_OF_BODY))
        parts = []
        for shape in shapes:
            geometry, origin, file, planes = shape.geometry, shape.origin, "", ()
            if isinstance(geometry, Mesh):
                planes = (mesh_cuts or {}).get(shape.link, ())
                file = self.wavefront(geometry, planes, concave)
            elif isinstance(geometry, Plane) and (len(shapes) > 1 or not np.allclose(origin, np.eye(4), atol=1e-12)):
                geometry, origin = Box(_SLAB_M), origin @ pose_matrix((0.0, 0.0, -_SLAB_M[2] / 2.0))
            parts.append(BulletShape(geometry, file, origin, bool(file and concave and not planes)))
        return gathered(parts, self._cache.keep)


class ShapeStore:
    """The collision shapes of one physics client, one compound for each set of geometries. PyBullet frees no shape that
    a body has used (5 kB for a box), so they stay for models of the same shape."""

    def __init__(self, client: int, mesh_files: MeshFiles) -> None:
        self._client = client
        self._mesh_files = mesh_files
        self._shapes = {}

    def compound(self, shapes: Sequence[Shape], concave: bool, mesh_cuts: dict[str, tuple[tuple, ...]] | None = None,
                 exact: bool = False) -> int:
        """Return PyBullet's id of the compound of ``shapes`` (urdf_model.Shape), or -1 for none.

        ``concave`` keeps meshes as triangles (only for bodies that never move); otherwise they are their convex hull.
        ``mesh_cuts``: as for ``World.spawn``; such a mesh becomes the convex hulls of its parts in either case.
        ``exact``: Bullet's margin of 1 mm does not make meshes larger.
        Raises BulletSimError as ``MeshFiles.parts`` does, Call that before, in another thread: it is the slow part.
        """
        parts = self._mesh_files.parts(shapes, concave, mesh_cuts)
        if not parts:
            return NO_SHAPE
        if exact:
            parts = [without_margin(part) for part in parts]
        key = tuple((geometry, file, origin.tobytes(), hollow) for geometry, file, origin, hollow in parts)
        if key not in self._shapes:
            self._shapes[key] = self._create(parts)
        return self._shapes[key]

    def _create(self, parts: list[BulletShape]) -> int:
        if isinstance(parts[0][0], Plane):
            return pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=self._client)
        columns = {
            "shapeTypes": [],
            "halfExtents": [],
            "radii": [],
            "lengths": [],
            "fileNames": [],
            "meshScales": [],
            "flags": [],
            "collisionFramePositions": [],
            "collisionFrameOrientations": [],
        }
        for geometry, file, origin, hollow in parts:
            columns["shapeTypes"].append(_SHAPE_TYPES[type(geometry)])
            columns["halfExtents"].append([side / 2.0 for side in getattr(geometry, "size", (0.0, 0.0, 0.0))])
            columns["radii"].append(getattr(geometry, "radius", 0.0))
            columns["lengths"].append(getattr(geometry, "length", 0.0))
            columns["fileNames"].append(file)
            columns["meshScales"].append(list(getattr(geometry, "scale", (1.0, 1.0, 1.0))))
            columns["flags"].append(pybullet.GEOM_FORCE_CONCAVE_TRIMESH if hollow else 0)
            columns["collisionFramePositions"].append(origin[:3, 3].tolist())
            columns["collisionFrameOrientations"].append(quaternion_from_matrix(origin).tolist())
        with _points_in_numbers():
            shape = pybullet.createCollisionShapeArray(**columns, physicsClientId=self._client)
        if shape < 0:
            raise BulletSimError("PyBullet made no collision shape of %s" % ([part[:2] for part in parts],))
        return shape


_SHAPE_TYPES = {
    Box: pybullet.GEOM_BOX,
    Cylinder: pybullet.GEOM_CYLINDER,
    Sphere: pybullet.GEOM_SPHERE,
    Mesh: pybullet.GEOM_MESH,
}


def principal_axes(inertia: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the principal moments (3,) of a (3, 3) inertia and the rotation (3, 3) whose columns are their axes."""
    moments, axes = np.linalg.eigh(inertia)
    if np.linalg.det(axes) < 0.0:
        axes[:, 0] = -axes[:, 0]
    return moments, axes
