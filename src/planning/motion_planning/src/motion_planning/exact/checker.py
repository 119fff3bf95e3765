# SPDX-License-Identifier: BSD-3-Clause
"""Contacts and distances of a robot in a scene."""
from __future__ import annotations

import math
import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import fcl
import numpy as np

from motion_planning.errors import PlanningError
from motion_planning.exact import kernels
from motion_planning.exact.geometry import grown, plane_overlap, simple_of
from motion_planning.exact.tables import (
    ATTACHED,
    OBJECT,
    ROBOT,
    CheckedShape,
    Fixed,
    Geometries,
    Movers,
    without_fixed_joints,
)
from motion_planning.model import ModelError
from motion_planning.shapes import Octree, TriangleMesh
from urdf_model import Mesh, Plane

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from motion_planning.exact.kernels import RobotAt
    from motion_planning.model import PlanningModel, State
    from motion_planning.scene import AllowedCollisions, Scene, WorldObject
    from motion_planning.shapes import Geometry, Meshes

T = TypeVar("T")
#: Pairs of movers; those that are checked against fixed shapes; what has been found of pairs of names.
_Pairing = tuple[np.ndarray, np.ndarray, dict[tuple[str, str], bool]]

#: Number of cached tables of scenes: a scene and its few successors are checked many times.
_KEPT = 12
# Number of shapes that are made between two looks at the clock; of postures that are checked at once, the first time
# and afterwards: where one is in collision, the first ones often are.
_AT_ONCE = 16
_FIRST_POSTURES, _POSTURES = 16, 64
_ANY = fcl.CollisionRequest(num_max_contacts=1, enable_contact=False)
_ALL = fcl.CollisionRequest(num_max_contacts=50, enable_contact=True)
_DISTANCE = fcl.DistanceRequest(enable_nearest_points=True)


@dataclass(frozen=True, eq=False)
class Contact:
    """Two bodies in contact. a_kind, b_kind: "robot" (a link), "object" (of the world) or "attached" (held).

    point (3,) in the planning frame [m]; normal (3,): unit, from a to b; depth [m]: of the overlap, an estimate between
    meshes.
    """

    a: str
    b: str
    a_kind: str
    b_kind: str
    point: np.ndarray
    normal: np.ndarray
    depth: float

    def __str__(self) -> str:
        words = {ROBOT: "link", OBJECT: "object", ATTACHED: "attached object"}
        return "%s '%s' and %s '%s' overlap by %.4f m" % (words[self.a_kind], self.a, words[self.b_kind], self.b,
                                                          self.depth)


class Nearest(NamedTuple):
    """The least distance [m], 0 for contacts, with the two bodies and the nearest point (3,) of each."""

    distance: float
    a: str
    b: str
    point_a: np.ndarray
    point_b: np.ndarray


class ExactChecker:
    """Checks states of one robot in scenes. Thread-safe; calls are serialized. Shapes are checked without
    approximation. As in FCL, a mesh is hollow and a cube of an octomap is solid. A plane is infinite and has no
    thickness, so it can be a floor, a wall or a ceiling. warnings: sentences about shapes that could not be read and
    are left out.
    """

    def __init__(self, model: PlanningModel, meshes: Meshes) -> None:
        """``meshes``: function from the file name of a mesh to its shapes.TriangleMesh, or raises PlanningError."""
        self.model, self.meshes = model, meshes
        self.warnings = []
        self._geometries = Geometries()
        self._kinematics, self._carriers = without_fixed_joints(model.kinematics)
        self._lock = threading.Lock()
        self._tables = OrderedDict()
        self._robot = self._robot_parts(meshes)
        self._rows = np.empty((256, 3), dtype=np.int64)
        # Shapes of the robot that no joint moves.
        self._still = frozenset(k for k, part in enumerate(self._robot) if not any(
            joint.movable for joint in model.robot.chain(model.root, part.name)))

    def free(self, scene: Scene, state: State | None = None, group: str | None = None) -> bool:
        """Whether ``state`` (None: the scene's) is free of collisions. ``group``: name of a group; then only pairs of
        which one moves with it are checked. Raises ModelError for an unknown group, and for joint values that do not
        fit the model or are not finite.
        """
        with self._lock:
            query = self._query(scene, state, group)
            return not any(self._touches(query, i, j) for i, j in self._near(query))

    def first_blocked(self, scene: Scene, postures: ArrayLike, group: str | None = None) -> int | None:
        """Return the index of the first of ``postures`` that is in collision, None if all are free.

        postures: (m, n), or (m, k) values of the joints of ``group``, the others as in the scene's state; faster than
        :meth:`free` for each. Errors as in :meth:`free`.
        """
        indices = slice(None) if group is None else self.model.group(group).indices
        rows = np.asarray(postures, dtype=np.float64)
        whole = np.tile(scene.state.q, (len(rows), 1))
        # Whole postures are recognized by their length; for a group with all joints, in its own order, both are the
        # same.
        if len(rows) and rows.shape[1:] == (len(self.model.variables),) != whole[0, indices].shape:
            indices = slice(None)
        if rows.shape != whole[:, indices].shape:
            raise ModelError("expected postures of %d joints, got an array of shape %s"
                             % (whole[:, indices].shape[1], rows.shape))
        whole[:, indices] = rows
        if not np.isfinite(whole).all():
            raise ModelError("joint values of posture %d are not all finite"
                             % np.flatnonzero(~np.isfinite(whole).all(axis=1))[0])
        with self._lock:
            query = self._query(scene, None, group)
            begin, count = 0, _FIRST_POSTURES
            while begin < len(whole):
                placed = -1
                for number, i, j in self._unproven(query, whole[begin : begin + count]):
                    if placed != number:
                        query.move(whole[begin + number], self._still)
                        placed = number
                    if self._touches(query, i, j):
                        return begin + number
                begin, count = begin + count, _POSTURES
        return None

    def contacts(self, scene: Scene, state: State | None = None, group: str | None = None,
                 most: int = 100) -> list[Contact]:
        """Return a list of Contact, the deepest one of each pair of bodies in contact; at most ``most``.

        Arguments and errors are those of :meth:`free`.
        """
        found = {}
        with self._lock:
            query = self._query(scene, state, group)
            for i, j in self._near(query):
                contact = self._contact(query, i, j)
                if contact is None:
                    continue
                key = contact.a, contact.b
                if key not in found or found[key].depth < contact.depth:
                    found[key] = contact
                if len(found) >= most:
                    break
        return list(found.values())

    def distance(self, scene: Scene, state: State | None = None, group: str | None = None) -> float:
        """Return the least distance [m] of two bodies that must not touch: 0 for contacts, inf if there are no such
        bodies.

        Arguments and errors are those of :meth:`free`.
        """
        nearest = self.nearest(scene, state, group)
        return math.inf if nearest is None else nearest.distance

    def nearest(self, scene: Scene, state: State | None = None, group: str | None = None) -> Nearest | None:
        """Return the Nearest of two bodies that must not touch, None if there are none.

        Arguments and errors are those of :meth:`free`.
        """
        best = None
        with self._lock:
            query = self._query(scene, state, group)
            rows, least = kernels.gaps(query.robot, query.movers.arrays, query.pairs, query.active,
                                       query.fixed.arrays, query.poses)
            for k in np.argsort(least, kind="stable"):
                if best is not None and least[k] >= best.distance:
                    break
                i, j = rows[k]
                if query.may_touch(i, j):
                    continue
                distance, point_a, point_b = self._gap(query, i, j)
                if best is None or distance < best.distance:
                    best = Nearest(distance, query.movers.parts[i].name, query.part(j).name, point_a, point_b)
                    if distance <= 0.0:
                        break
        return best

    def prepare(self, scene: Scene, group: str | None = None, check: Callable[[], None] = lambda: None) -> None:
        """Make what the first question about a scene would make. ``check()`` is called between shapes; what it raises
        ends the preparation, and what is made by then is kept. Raises PlanningError for objects in hand that cannot be
        checked against each other."""
        held = [shape for body in scene.state.attached.values() for shape, _ in body.object.shapes]
        of_things = [shape for thing in _things(scene) for shape, _ in thing.shapes]
        for (key, _), shapes in ((self._movers_key(scene, scene.state), held), (self._fixed_key(scene), of_things)):
            for begin in range(0, 0 if key in self._tables else len(shapes), _AT_ONCE):
                check()
                with self._lock:
                    for shape in shapes[begin : begin + _AT_ONCE]:
                        if simple_of(shape) is None:
                            self._geometries.of(shape)
                        self._geometries.geometry(shape)
        check()
        with self._lock:
            self._query(scene, None, group)

    # -- a question about a state -------------------------------------------------------------------------------

    def _query(self, scene: Scene, state: State | None, group: str | None) -> _Query:
        state = scene.state if state is None else state
        q = np.array(state.q, dtype=np.float64)
        if q.shape != (len(self.model.variables),) or not math.isfinite(q.dot(q)):
            self.model.checked(q)
            raise ModelError("joint values are not all finite: %s" % dict(zip(self.model.variables, q.tolist(),
                                                                              strict=True)))
        movers = self._movers(scene, state)
        pairs, active, memory = self._pairing(scene, movers, group)
        base = np.array(state.base)
        if not math.isfinite(base.sum()):
            raise ModelError("the pose of link '%s' is not finite: %s" % (self.model.root, base.tolist()))
        return _Query((self._kinematics, q, base), movers, (pairs, active),
                      self._fixed(scene), scene.allowed, memory)

    def _near(self, query: _Query) -> list[list[int]]:
        """List of [i, j] that may touch, as from kernels.unproven, without allowed pairs. Their poses are filled."""
        found = [[i, j] for _, i, j in self._unproven(query, query.robot[1][None])]
        if found:
            query.move(query.robot[1], frozenset())
        return found

    def _unproven(self, query: _Query, postures: np.ndarray) -> list[list[int]]:
        """List of [number of a posture (p, n), i, j], as from kernels.unproven, without allowed pairs."""
        kinematics, _, base = query.robot
        arguments = ((kinematics, base), postures, query.movers.arrays, (query.pairs, query.active), query.fixed.arrays)
        count = kernels.unproven(*arguments, self._rows)
        if count > len(self._rows):
            self._rows = np.empty((2 * count, 3), dtype=np.int64)
            count = kernels.unproven(*arguments, self._rows)
        return [row for row in self._rows[:count].tolist() if not query.may_touch(*row[1:])]

    def _touches(self, query: _Query, i: int, j: int) -> bool:
        a, b = query.object(i), query.object(j)
        if a is None or b is None:
            return query.plane_depth(i, j) >= 0.0
        return fcl.collide(a, b, _ANY, fcl.CollisionResult()) > 0

    def _contact(self, query: _Query, i: int, j: int) -> Contact | None:
        a, b = query.object(i), query.object(j)
        part, other = query.movers.parts[i], query.part(j)
        names = part.name, other.name, part.kind, other.kind
        if a is None or b is None:
            depth = query.plane_depth(i, j)
            if depth < 0.0:
                return None
            return Contact(*names, *query.plane_point(i, j), depth)
        result = fcl.CollisionResult()
        if not fcl.collide(a, b, _ALL, result):
            # If shapes barely touch, FCL may report a contact without its point.
            return _touch(names, query.poses[i], query.pose(j)) if self._touches(query, i, j) else None
        found = result.contacts
        # Between triangles FCL's depths are those of their planes: the least one is the most accurate.
        both = isinstance(part.shape, TriangleMesh) and isinstance(other.shape, TriangleMesh)
        one = (min if both else max)(found, key=lambda contact: abs(contact.penetration_depth))
        # FCL changes the order for some pairs of shapes, and reports it.
        turned = one.o1 is query.geometry(j) and query.geometry(i) is not query.geometry(j)
        normal = -one.normal if turned else one.normal
        return Contact(*names, np.array(one.pos), np.array(normal), abs(one.penetration_depth))

    def _gap(self, query: _Query, i: int, j: int) -> tuple[float, np.ndarray, np.ndarray]:
        a, b = query.object(i), query.object(j)
        if a is None or b is None:
            depth = query.plane_depth(i, j)
            point, normal = query.plane_point(i, j)
            return max(0.0, -depth), point + min(0.0, depth) * normal, point
        if fcl.collide(a, b, _ANY, fcl.CollisionResult()):
            middle = query.poses[i][:3, 3]
            return 0.0, middle, middle
        result = fcl.DistanceResult()
        distance = fcl.distance(a, b, _DISTANCE, result)
        one, other = result.nearest_points
        return max(0.0, float(distance)), np.array(one), np.array(other)

    # -- tables -------------------------------------------------------------------------------------------------

    def _robot_parts(self, meshes: Meshes) -> list[CheckedShape]:
        parts = []
        for index, name in enumerate(self.model.links):
            for collision in self.model.robot.links[name].collisions:
                try:
                    shape = _read(collision.geometry, meshes)
                except PlanningError as error:
                    self.warnings.append("%s; link '%s' is checked without it" % (error, name))
                    continue
                parts.append(CheckedShape(name, ROBOT, index, shape, collision.origin))
        return parts

    def _kept(self, key: Hashable, held: object, make: Callable[[], T]) -> T:
        """``make()``, or its cached result for the same key; ``held``: the objects whose identities form the key."""
        entry = self._tables.get(key)
        if entry is None:
            entry = self._tables[key] = held, make()
            while len(self._tables) > 3 * _KEPT:
                self._tables.popitem(last=False)
        else:
            self._tables.move_to_end(key)
        return entry[1]

    @staticmethod
    def _movers_key(scene: Scene, state: State) -> tuple[Hashable, object]:
        held = tuple(table for table in (state.attached, scene.link_padding, scene.link_scale) if table)
        return ("movers", *map(id, held)), held

    def _movers(self, scene: Scene, state: State) -> Movers:
        return self._kept(*self._movers_key(scene, state), lambda: self._make_movers(scene, state))

    def _make_movers(self, scene: Scene, state: State) -> Movers:
        parts = self._robot
        if scene.link_padding or scene.link_scale:
            parts = [part._replace(shape=grown(part.shape, scene.link_padding.get(part.name, 0.0),
                                               scene.link_scale.get(part.name, 1.0))) for part in parts]
        bodies = state.attached.values()
        held = [CheckedShape(body.id, ATTACHED, self.model.link_index[body.link], shape, body.object.pose @ pose)
                for body in bodies for shape, pose in body.object.shapes]
        return Movers(parts + held, self._geometries, {body.id: body.touch_links for body in bodies},
                      self._carriers)

    def _pairing(self, scene: Scene, movers: Movers, group: str | None) -> _Pairing:
        held = movers, scene.allowed
        return self._kept(("pairs", *map(id, held), group), held,
                          lambda: self._make_pairing(scene.allowed, movers, group))

    def _make_pairing(self, allowed: AllowedCollisions, movers: Movers, group: str | None) -> _Pairing:
        moving, carriers = None, np.arange(len(self._kinematics[0]))
        if group is not None:
            moving = {self.model.link_index[link] for link in self.model.group(group).moving_links}
            carriers = [self._carriers[link][0] for link in moving]
        return movers.pairs(allowed, moving), np.flatnonzero(np.isin(movers.arrays[0], carriers)), {}

    @staticmethod
    def _fixed_key(scene: Scene) -> tuple[Hashable, object]:
        held = scene.objects, scene.octomap
        return ("fixed", *map(id, held)), held

    def _fixed(self, scene: Scene) -> Fixed:
        return self._kept(*self._fixed_key(scene), lambda: self._make_fixed(scene))

    def _make_fixed(self, scene: Scene) -> Fixed:
        return Fixed([CheckedShape(thing.id, OBJECT, -1, shape, thing.pose @ pose) for thing in _things(scene)
                      for shape, pose in thing.shapes], self._geometries)


def _things(scene: Scene) -> list[WorldObject]:
    """The objects of a scene and its octomap that have shapes to check."""
    octomap = scene.octomap
    if octomap is not None and any(isinstance(shape, Octree) and len(shape.boxes) for shape, _ in octomap.shapes):
        return [*scene.objects.values(), octomap]
    return list(scene.objects.values())


class _Query:
    """One state in one scene: poses of all bodies, computed on demand."""

    def __init__(self, robot: RobotAt, movers: Movers, checked: tuple[np.ndarray, np.ndarray],
                 fixed: Fixed, allowed: AllowedCollisions, memory: dict[tuple[str, str], bool]) -> None:
        self.robot, self.movers, (self.pairs, self.active), self.fixed = robot, movers, checked, fixed
        self.poses = np.empty((len(movers.parts), 4, 4))
        self._allowed, self._memory, self._placed = allowed, memory, set()

    def move(self, q: np.ndarray, still: frozenset[int]) -> None:
        """Move the robot to ``q`` (n,); movers in ``still`` keep their poses."""
        self.robot = self.robot[0], q, self.robot[2]
        self._placed &= still
        kernels.fill_poses(self.robot, self.movers.arrays, self.poses)

    def may_touch(self, i: int, j: int) -> bool:
        """Whether mover ``i`` may touch the fixed shape ``j`` < 0; allowed pairs of two movers are excluded before."""
        if j >= 0:
            return False
        key = self.movers.parts[i].name, self.fixed.parts[-1 - j].name
        if key not in self._memory:
            self._memory[key] = self._allowed.allowed(*key)
        return self._memory[key]

    def part(self, j: int) -> CheckedShape:
        return self.movers.parts[j] if j >= 0 else self.fixed.parts[-1 - j]

    def geometry(self, j: int) -> Any:
        return self.movers.geometries[j] if j >= 0 else self.fixed.geometry(-1 - j)

    def pose(self, j: int) -> np.ndarray:
        return self.poses[j] if j >= 0 else self.fixed.poses[-1 - j]

    def object(self, j: int) -> Any:
        """The fcl.CollisionObject of a mover or fixed shape at its pose, None for a plane."""
        if j < 0:
            return self.fixed.object(-1 - j)
        one = self.movers.objects[j]
        if one is not None and j not in self._placed:
            pose = self.poses[j]
            one.setTransform(fcl.Transform(pose[:3, :3], pose[:3, 3]))
            self._placed.add(j)
        return one

    def plane_depth(self, i: int, j: int) -> float:
        """The overlap of the two, one of them a plane; below 0 their distance."""
        if isinstance(self.part(i).shape, Plane):
            i, j = j, i
        if isinstance(self.part(i).shape, Plane):
            return -math.inf
        return plane_overlap(self.pose(j), self.part(i).shape, self.pose(i))

    def plane_point(self, i: int, j: int) -> tuple[np.ndarray, np.ndarray]:
        """(point (3,) on the plane below or above the other's middle, normal (3,) from mover ``i`` to ``j``)."""
        is_plane = isinstance(self.part(i).shape, Plane)
        plane, other = (self.pose(i), self.pose(j)) if is_plane else (self.pose(j), self.pose(i))
        height = float(plane[:3, 2] @ (other[:3, 3] - plane[:3, 3]))
        away = plane[:3, 2] if height >= 0.0 else -plane[:3, 2]
        return other[:3, 3] - height * plane[:3, 2], away if is_plane else -away


def _touch(names: tuple[str, str, str, str], pose: np.ndarray, other: np.ndarray) -> Contact:
    """The Contact of two shapes at ``pose`` and ``other`` (4, 4) for which FCL reports no contact point."""
    way = other[:3, 3] - pose[:3, 3]
    length = float(np.linalg.norm(way))
    normal = way / length if length > 1e-9 else np.array((0.0, 0.0, 1.0))
    return Contact(*names, 0.5 * (pose[:3, 3] + other[:3, 3]), normal, 0.0)


def _read(geometry: Geometry | Mesh, meshes: Meshes) -> Geometry:
    if not isinstance(geometry, Mesh):
        return geometry
    mesh = meshes(geometry.filename)
    if tuple(geometry.scale) == (1.0, 1.0, 1.0):
        return mesh
    return TriangleMesh(mesh.vertices * np.array(geometry.scale), mesh.triangles)
