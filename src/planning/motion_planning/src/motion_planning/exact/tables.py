# SPDX-License-Identifier: BSD-3-Clause
"""The shapes of a robot, of what it holds and of the world, as the compiled code and FCL want them."""
from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple
from weakref import WeakKeyDictionary

import fcl
import numpy as np

from motion_planning.errors import PlanningError
from motion_planning.exact import apart, kernels
from motion_planning.exact.geometry import bounds_of, fcl_geometry, form_of, simple_of

if TYPE_CHECKING:
    from motion_planning.exact.apart import Forms
    from motion_planning.exact.geometry import ShapeBounds, ShapeForm
    from motion_planning.model.kernels import Kinematics
    from motion_planning.scene import AllowedCollisions
    from motion_planning.shapes import Geometry

    #: Index of a link, and a pose (4, 4) in its frame.
    Carrier = tuple[int, np.ndarray]

ROBOT, OBJECT, ATTACHED = "robot", "object", "attached"
#: Fixed shapes of one chunk: all of them are passed over when the chunk's ball is far away.
_CHUNK = 32
# Greatest number of pairs of shapes that move with the robot.
_MAX_PAIRS = 5_000_000


class CheckedShape(NamedTuple):
    """One shape of something. name: of the link or object; kind: ROBOT, OBJECT or ATTACHED; link: index of the link
    that it moves with, -1 where it stands in the world; pose (4, 4): in that link, or in the planning frame."""

    name: str
    kind: str
    link: int
    shape: Geometry
    pose: np.ndarray


def without_fixed_joints(kinematics: Kinematics) -> tuple[Kinematics, list[Carrier]]:
    """Return (kinematics, carriers) without the fixed joints of ``kinematics``, see ``model.kernels``: of the root and
    the links behind the other joints alone; for each link the index of the one among them that it moves with, and its
    pose (4, 4) there."""
    parents, origins, axes, kinds, variables, factors = kinematics
    kept, carriers, above, ways = [], [], [], []
    for link, parent in enumerate(parents):
        carrier, pose = (-1, np.eye(4)) if parent < 0 else carriers[parent]
        pose = pose @ origins[link]
        if parent < 0 or kinds[link]:
            above.append(carrier)
            ways.append(pose)
            carrier, pose = len(kept), np.eye(4)
            kept.append(link)
        carriers.append((carrier, pose))
    return (np.array(above, parents.dtype), np.array(ways), axes[kept], kinds[kept], variables[kept],
            factors[kept]), carriers


class Geometries:
    """Bounds, forms and FCL geometries of shapes, each made once as long as the shape lives."""

    def __init__(self) -> None:
        self._known, self._geometries = WeakKeyDictionary(), WeakKeyDictionary()

    def of(self, shape: Geometry) -> tuple[ShapeBounds, ShapeForm]:
        """Return the ShapeBounds and the ShapeForm of a mesh or octree."""
        entry = self._known.get(shape)
        if entry is None:
            bounds = bounds_of(shape)
            entry = self._known[shape] = bounds, form_of(shape, bounds)
        return entry

    def tables(self, shapes: Sequence[Geometry]) -> tuple[np.ndarray, np.ndarray, np.ndarray, Forms]:
        """Return centres (n, 3), half sides (n, 3) and radii (n,) of the bounds of shapes, and their forms, see
        ``apart``."""
        count = len(shapes)
        centres, halves, radii = np.zeros((count, 3)), np.empty((count, 3)), np.empty(count)
        kinds, counts, slabs = np.empty(count, np.int64), np.ones(count, np.int64), np.full(count, -1)
        made, heights = {}, []
        for k, shape in enumerate(shapes):
            simple = simple_of(shape)
            if simple is not None:
                kinds[k], halves[k], radii[k] = simple
                continue
            bounds, form = self.of(shape)
            kinds[k], centres[k], halves[k], radii[k] = apart.BOX, *bounds
            counts[k], made[k] = len(form.nodes), form.nodes
            if form.heights is not None:
                slabs[k] = len(heights)
                heights.append(form.heights)
        firsts = np.cumsum(counts) - counts
        nodes = np.zeros((counts.sum(), 6))
        nodes[firsts, 3:] = halves
        for k, some in made.items():
            nodes[firsts[k] : firsts[k] + counts[k]] = some
        return centres, halves, radii, (kinds, firsts, counts, nodes, slabs,
                                        np.array(heights).reshape(-1, len(apart.DIRECTIONS)))

    def geometry(self, shape: Geometry) -> Any:
        """Return the FCL geometry of a shape, None for a plane."""
        if shape not in self._geometries:
            self._geometries[shape] = fcl_geometry(shape)
        return self._geometries[shape]


class Movers:
    """Shapes that move with the robot."""

    def __init__(self, parts: Sequence[CheckedShape], geometries: Geometries, touch: Mapping[str, frozenset[str]],
                 carriers: Sequence[Carrier]) -> None:
        """``parts``: [CheckedShape]; ``touch``: {name of something held: links that it may touch}; carriers: see
        ``without_fixed_joints``."""
        self.parts, self.touch = parts, touch
        self.geometries = [geometries.geometry(part.shape) for part in parts]
        self.objects = [None if geometry is None else fcl.CollisionObject(geometry) for geometry in self.geometries]
        count = len(parts)
        local = np.array([carriers[part.link][1] @ part.pose for part in parts], dtype=float).reshape(count, 4, 4)
        centres, halves, radii, forms = geometries.tables([part.shape for part in parts])
        self.arrays = (np.array([carriers[part.link][0] for part in parts], dtype=np.int64), local, centres, halves,
                       radii, forms, np.einsum("nab,nb->na", local[:, :3, :3], centres) + local[:, :3, 3])

    def pairs(self, allowed: AllowedCollisions, moving: set[int] | None) -> np.ndarray:
        """Return (p, 2) indices of movers that are checked against each other, of two things each.

        ``moving``: set of link indices of which at least one is in each pair, None for all.
        """
        of = {}
        for number, part in enumerate(self.parts):
            of.setdefault((part.name, part.kind), []).append(number)
        # One part of each thing: the others move with it.
        ones = [self.parts[numbers[0]] for numbers in of.values()]
        may = self._may_touch(allowed, ones)
        if moving is not None:
            still = np.array([one.link not in moving for one in ones], dtype=bool)
            may |= still[:, None] & still
        numbers = [np.array(some) for some in of.values()]
        apart = np.argwhere(np.triu(~may, 1))
        count = sum(len(numbers[a]) * len(numbers[b]) for a, b in apart)
        if count > _MAX_PAIRS:
            raise PlanningError("the robot holds objects of %d shapes, %d pairs of which would have to be checked; at "
                                "most %d are. Join shapes to a mesh, or allow what is held to touch"
                                % (len(self.parts), count, _MAX_PAIRS))
        found = [np.stack(np.meshgrid(numbers[a], numbers[b], indexing="ij"), axis=-1).reshape(-1, 2) for a, b in apart]
        if not found:
            return np.empty((0, 2), dtype=np.int64)
        return np.sort(np.concatenate(found), axis=1)

    def _may_touch(self, allowed: AllowedCollisions, ones: Sequence[CheckedShape]) -> np.ndarray:
        """(n, n) bool: whether two of ``ones`` (n Parts), one of each thing, may touch."""
        may = allowed.among([one.name for one in ones])
        links = np.array([one.link for one in ones])
        held = np.array([one.kind == ATTACHED for one in ones], dtype=bool)
        may |= (links[:, None] == links) & held[:, None] & held
        index = {one.name: k for k, one in enumerate(ones) if one.kind == ROBOT}
        for k in np.flatnonzero(held):
            for link in self.touch[ones[k].name]:
                if link in index:
                    may[k, index[link]] = may[index[link], k] = True
        np.fill_diagonal(may, True)
        return may


class Fixed:
    """Shapes that stand in the world."""

    def __init__(self, parts: Sequence[CheckedShape], geometries: Geometries) -> None:
        count = len(parts)
        poses = np.array([part.pose for part in parts], dtype=float).reshape(count, 4, 4)
        local, halves, radii, (kinds, firsts, counts, nodes, slabs, heights) = geometries.tables(
            [part.shape for part in parts])
        centres = np.einsum("nab,nb->na", poses[:, :3, :3], local) + poses[:, :3, 3]
        order = _neighbours_together(centres, radii)
        self.parts, self.poses = [parts[k] for k in order], poses[order]
        centres, halves, radii = centres[order], halves[order], radii[order]
        forms = kinds[order], firsts[order], counts[order], nodes, slabs[order], heights
        self._geometries, self._objects = geometries, [None] * count
        starts = np.append(np.arange(0, count, _CHUNK), count)
        self.arrays = (np.ascontiguousarray(self.poses[:, :3, :3]), centres, halves, radii, starts,
                       kernels.balls_of(centres, radii, starts), forms)

    def object(self, k: int) -> Any:
        """Return the fcl.CollisionObject of shape ``k``, None for a plane; made when it is first needed."""
        if self._objects[k] is None and self.geometry(k) is not None:
            pose = self.poses[k]
            self._objects[k] = fcl.CollisionObject(self.geometry(k), fcl.Transform(pose[:3, :3], pose[:3, 3]))
        return self._objects[k]

    def geometry(self, k: int) -> Any:
        """Return the FCL geometry of shape ``k``, None for a plane."""
        return self._geometries.geometry(self.parts[k].shape)


def _neighbours_together(centres: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """Order in which what is near each other comes together: large things first, then along a curve through cells."""
    if len(centres) <= _CHUNK:
        return np.arange(len(centres))
    cell = np.floor((centres - centres.min(axis=0)) / max(1e-3, float(np.ptp(centres, axis=0).max())) * 1023.0)
    cell = cell.astype(np.int64)
    code = np.zeros(len(centres), dtype=np.int64)
    for bit in range(10):
        for axis in range(3):
            code |= ((cell[:, axis] >> bit) & 1) << (3 * bit + axis)
    large = radii > 4.0 * np.median(radii)
    return np.lexsort((code, ~large))
