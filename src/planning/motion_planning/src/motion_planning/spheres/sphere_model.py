# SPDX-License-Identifier: BSD-3-Clause
"""The spheres of all links of a robot, made once from its collision geometry and cached on disk."""
from __future__ import annotations

import contextlib
import hashlib
import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np

from disk_cache.compiled import folder
from disk_cache.files import draft_of
from motion_planning.errors import PlanningError
from motion_planning.exact.geometry import bounds_of
from motion_planning.shapes import TriangleMesh
from motion_planning.spheres.cover import (
    ROUNDING,
    CoverError,
    boxes_of_cells,
    cover,
    cover_object,
    points_on,
    sample_count,
    used_corners,
    voxels,
)
from urdf_model import Box, Cylinder, Mesh

if TYPE_CHECKING:
    from motion_planning.model import PlanningModel
    from motion_planning.shapes import Geometry, Meshes, Placed

T = TypeVar("T")

#: How far a sphere may reach beyond the geometry [m]; for thin geometry, this share of its thinnest half side, ...
TOLERANCE_M = 0.01
_THIN_SHARE = 0.35
# ... but not less than this share of the tolerance.
_MIN_SHARE = 0.4
#: Boxes that replace a mesh have sides of this size and its multiples [m]...
MESH_CELL_M = 0.006
# ... or larger ones, so that the longest side of the mesh has at most this many.
_MAX_CELLS = 150
# Greatest number of boxes of a mesh and of samples on it, and the growth of the cells where one of the two is exceeded.
_MAX_BOXES, _COARSER = 20_000, 1.6
_MAX_POINTS, _LARGER = 8_000_000, 1.25
# Boxes reach beyond the samples in their cells by this share of a cell, the distance of samples.
_SHARE_BEYOND = 0.3
# A shape without time for more is covered by balls around this many parts of its longest side.
_PARTS = 4
# Boxes and spheres that are coarser than usual by more than this factor are worth a remark.
_REMARKABLE = 1.3
# Tables of robots and of links that stand still; maps of pairs of links; tables of whole scenes, which are large.
_MAX_KEPT, _MAX_MAPS, _MAX_SCENES = 400, 10_000, 4
# What is kept on disk is made by these.
_SOURCES = [Path(__file__).with_name(name) for name in ("cover.py", "covering.py", "pair_maps.py")]


class Patience(NamedTuple):
    """How long the preparation of a scene may take. late(): whether the rest is to be made as coarse as possible.
    check(): called now and then; what it raises ends the preparation."""

    late: Callable[[], bool] = lambda: False
    check: Callable[[], None] = lambda: None


class SphereModel:
    """Spheres and boxes that contain the collision geometry of each link, made on first use. Thread-safe. They are
    cached on disk beside compiled code, by geometry and tolerance [m].
    """

    def __init__(self, model: PlanningModel, parts: dict[str, list[Placed]], tolerance: float) -> None:
        self.model, self.tolerance = model, tolerance
        self._parts, self._spheres, self._fixed = parts, {}, {}
        #: What was made for a key: ``kept(key, make)`` returns ``make()``, made again only when many others have been
        #: asked for since; ``maps`` and ``scenes`` the same for maps of pairs of links, and for tables of whole scenes.
        self.kept, self.maps, self.scenes = Kept(_MAX_KEPT), Kept(_MAX_MAPS), Kept(_MAX_SCENES)

    @classmethod
    def of(cls, model: PlanningModel, meshes: Meshes, tolerance: float = TOLERANCE_M) -> SphereModel:
        """Return the SphereModel of a PlanningModel.

        ``meshes``: function from a mesh's filename to its TriangleMesh in the file's own scale. Meshes for which it
        raises PlanningError are left out, as in ExactChecker, which reports them.
        """
        parts = {name: [] for name in model.links}
        for name in model.links:
            for shape in model.robot.links[name].collisions:
                try:
                    parts[name].append((_scaled(shape.geometry, meshes), shape.origin))
                except PlanningError:
                    continue
        return cls(model, parts, tolerance)

    def spheres(self, link: str) -> np.ndarray:
        """Return (n, 4), centre in the link's frame and radius [m], for a moving link; n may be 0.

        Raises CoverError.
        """
        if link not in self._spheres:
            parts = self._parts[link]
            self._spheres[link] = cached(cover, parts, fitting(parts, self.tolerance)) if parts else np.empty((0, 4))
        return self._spheres[link]

    def fixed(self, link: str) -> list[tuple[Geometry | Boxes, np.ndarray]]:
        """Return [(geometry, pose (4, 4) in the link's frame)], for a link that does not move: meshes as Boxes."""
        if link not in self._fixed:
            self._fixed[link] = [(boxes_of(geometry), pose) for geometry, pose in self._parts[link]]
        return self._fixed[link]

    def parts(self, link: str) -> list[Placed]:
        """Return [(geometry, pose (4, 4) in the link's frame)]: its collision geometry, meshes as TriangleMesh."""
        return self._parts[link]

    def not_kept(self) -> list[str]:
        """Return names of the links whose spheres are not on disk."""
        return [name for name, parts in self._parts.items()
                if parts and not _file(cover, parts, fitting(parts, self.tolerance)).exists()]


class Kept:
    """The last ``most`` things that were made. Any thread may call."""

    def __init__(self, most: int) -> None:
        self._most, self._things, self._lock = most, OrderedDict(), threading.Lock()

    def __call__(self, key: Hashable, make: Callable[[], T]) -> T:
        with self._lock:
            if key in self._things:
                self._things.move_to_end(key)
                return self._things[key]
        made = make()
        with self._lock:
            self._things[key] = made
            while len(self._things) > self._most:
                self._things.popitem(last=False)
        return made

    def forget(self, key: Hashable) -> None:
        """Make it again when it is asked for next."""
        with self._lock:
            self._things.pop(key, None)


def fitting(parts: Sequence[Placed], tolerance: float) -> float:
    """Return the tolerance [m] for parts of these sizes: thin parts get a closer fit."""
    half = [0.5 * min(geometry.size) for geometry, _ in parts if isinstance(geometry, Box)]
    half += [min(geometry.radius, 0.5 * geometry.length) for geometry, _ in parts if isinstance(geometry, Cylinder)]
    return tolerance * float(np.clip(_THIN_SHARE * min(half, default=np.inf) / tolerance, _MIN_SHARE, 1.0))


class Boxes:
    """Boxes that replace a mesh. corners (n, 2, 3): least and greatest, in the frame of the shape. coarse: size of the
    mesh's cells [m] if it is larger than usual, else None."""

    def __init__(self, corners: np.ndarray, coarse: float | None = None) -> None:
        self.corners, self.coarse = corners, coarse


def boxes_of(geometry: Geometry) -> Geometry | Boxes:
    """Return ``geometry`` unchanged, or Boxes that contain it if it is a mesh; made once per mesh."""
    if not isinstance(geometry, TriangleMesh):
        return geometry
    made = cached(mesh_boxes, [(geometry, np.eye(4))], MESH_CELL_M)
    cell, wanted = made[0, 0, :2]
    return Boxes(made[1:], float(cell) if cell > _REMARKABLE * wanted else None)


def box_around(geometry: Geometry) -> Boxes:
    """Return the Boxes of a shape's bounding box."""
    bounds = bounds_of(geometry)
    return Boxes(np.array([[bounds.centre - bounds.half, bounds.centre + bounds.half]]))


def mesh_boxes(parts: Sequence[tuple[TriangleMesh, np.ndarray]], cell: float) -> np.ndarray:
    """Return boxes (1 + n, 2, 3) that contain a mesh and its inside, and exceed it by at most two cells. The first row
    begins with the size of these [m], larger than ``cell`` for a large mesh, and the size wanted for one of so many
    metres."""
    (mesh, _), = parts
    vertices, triangles = used_corners(mesh.vertices, mesh.triangles)
    cell = wanted = max(cell, float(np.ptp(vertices, axis=0).max()) / _MAX_CELLS)
    while True:
        while sample_count(vertices, triangles, _SHARE_BEYOND * cell) > _MAX_POINTS:
            cell *= _LARGER
        full, lowest = voxels(points_on(vertices, triangles, _SHARE_BEYOND * cell), cell)
        try:
            boxes = boxes_of_cells(full, lowest, cell, beyond=_SHARE_BEYOND * cell, most=_MAX_BOXES)
            return np.concatenate([[[[cell, wanted, 0.0], [0.0, 0.0, 0.0]]], boxes])
        except CoverError:
            cell *= _COARSER


def object_spheres(parts: Sequence[Placed], tolerance: float, late: bool) -> tuple[np.ndarray, float | None]:
    """Return (spheres (n, 4) that contain ``parts`` as in ``cover``, how far they reach beyond them [m] if that is
    more than usual, else None). late: make few large ones."""
    wanted = fitting(parts, tolerance)
    if not late:
        try:
            made = cached(cover_object, parts, wanted)
            return made[1:], float(made[0, 0]) if made[0, 0] > _REMARKABLE * wanted else None
        except CoverError:
            pass  # extreme sizes
    spheres = np.concatenate([_balls_around(geometry, pose) for geometry, pose in parts])
    return spheres, float(spheres[:, 3].max())


def _balls_around(geometry: Geometry, pose: np.ndarray) -> np.ndarray:
    """Balls (n, 4) that together contain a shape's bounding box."""
    bounds = bounds_of(geometry)
    count = np.maximum(1, np.ceil(_PARTS * bounds.half / max(float(bounds.half.max()), 1e-9))).astype(int)
    cells = np.indices(count).reshape(3, -1).T
    centres = bounds.centre + bounds.half * ((2.0 * cells + 1.0) / count - 1.0)
    radius = float(np.linalg.norm(bounds.half / count)) * (1.0 + 1e-6) + ROUNDING
    return np.column_stack([centres @ pose[:3, :3].T + pose[:3, 3], np.full(len(centres), radius)])


def cached(function: Callable[[Any, Any], np.ndarray], parts: Sequence[Placed], size: Any) -> np.ndarray:
    """Return ``function(parts, size)``, an array, from disk if it has been made before."""
    path = _file(function, parts, size)
    try:
        return np.load(path)
    except (OSError, ValueError, EOFError):
        pass
    made = function(parts, size)
    # A cache that cannot be written is ignored; callers can check with ``not_kept``.
    with contextlib.suppress(OSError), draft_of(path) as draft:
        np.save(draft, made)
    return made


def _file(function: Callable[[Any, Any], np.ndarray], parts: Sequence[Placed], size: Any) -> Path:
    """The path of the cache file for ``function`` and ``parts``."""
    digest = hashlib.sha256(repr((function.__name__, size)).encode())
    for geometry, pose in parts:
        digest.update(np.ascontiguousarray(pose).tobytes())
        if isinstance(geometry, TriangleMesh):
            digest.update(geometry.vertices.tobytes() + geometry.triangles.tobytes())
        else:
            digest.update(repr(geometry).encode())
    return Path(folder("motion_planning_spheres", _SOURCES)) / (digest.hexdigest()[:32] + ".npy")


def _scaled(geometry: Geometry | Mesh, meshes: Meshes) -> Geometry:
    if not isinstance(geometry, Mesh):
        return geometry
    mesh = meshes(geometry.filename)
    return TriangleMesh(mesh.vertices * np.array(geometry.scale), mesh.triangles)
