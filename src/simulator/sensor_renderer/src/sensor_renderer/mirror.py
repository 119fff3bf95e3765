# SPDX-License-Identifier: BSD-3-Clause
"""The world for the renderer: the bodies of the snapshot, posed by our own forward kinematics. ROS-free."""
from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from bullet_sim import MeshCache
from sensor_renderer import triangles
from sensor_renderer.light import SceneLight
from urdf_model import Box, Finish, Mesh, merge_fixed, parse_urdf
from urdf_model.transforms import matrix_from_quaternion, rigid
from world_picture.background import NotReady
from world_picture.drawing import DrawingError, read_level, read_uv
from world_picture.shared_picture import PictureReader
from world_picture.snapshot import SnapshotError
from world_picture.textures import find_texture

if TYPE_CHECKING:
    from urdf_model import Joint
    from world_picture.drawing import DrawingCache

DEFAULT_COLOUR = (0.7, 0.7, 0.7, 1.0)
_WHITE = (1.0, 1.0, 1.0, 1.0)
#: Gloss of what does not say: paint and plastic.
GLOSS = 0.3
#: So many shapes of models that are gone are kept, for models that come again.
MAX_UNUSED = 100
# Of a round thing, one pixel in sixteen has a surface so slanted that its depth is off by this many times the distance
# from the surface, or more.
_SLANTED = 4.0
#: How far the floor reaches [m]; its colour.
FLOOR_HALF_M = 50.0
FLOOR_COLOUR = (0.75, 0.77, 0.80, 1.0)


class DetailLevel(NamedTuple):
    """A level of detail of a part: its distance from the original [m]; ``make()`` -> its triangles (3 m, 6);
    ``uv()`` -> the corners' places in a picture (3 m, 2), for parts with a material."""

    error_m: float
    make: Callable[[], np.ndarray]
    uv: Callable[[], np.ndarray]


class PartLook(NamedTuple):
    """The look of parts that have more than a colour. ``texture``: the path of a picture, or ""; ``factor`` of its
    colours, and ``emission``, light of its own: red, green, blue from 0 to 1; ``repeats``: how often the picture lies
    side by side, and one below the other; ``cut_out``: whether its transparent pixels are holes; ``two_sided``: whether
    it is seen from behind; ``opacity``: how much of what is behind it is covered, 1 being all."""

    texture: str
    factor: tuple[float, ...]
    emission: tuple[float, ...]
    repeats: tuple[float, ...] = (1.0, 1.0)
    cut_out: bool = False
    two_sided: bool = True
    opacity: float = 1.0


class DrawnPart(NamedTuple):
    """Triangles of one colour on one body. ``key`` is the same for equal triangles; rgba from 0 to 1. ``levels``: of
    the same shape, the finest first; none for shapes that have no other. ``gloss``: strength of its highlights, from 0
    to 1. ``material``: None for a colour alone; else ``colour`` is about the mean. ``uv`` (3 m, 2): the corners' places
    in its picture, if there are no levels. ``is_mesh``: whether its triangles are of a mesh file."""

    key: tuple[object, ...]
    triangles: np.ndarray
    colour: tuple[float, ...]
    is_floor: bool = False
    levels: tuple[DetailLevel, ...] = ()
    gloss: float = GLOSS
    material: PartLook | None = None
    uv: np.ndarray | None = None
    is_mesh: bool = False

    def level(self, error_m: float) -> int:
        """The number of the coarsest level that is within ``error_m`` [m] of the original; 0, the finest, if none."""
        return max((number for number, level in enumerate(self.levels) if level.error_m <= error_m), default=0)

    def triangles_of(self, number: int) -> np.ndarray:
        """The triangles of the level of that number."""
        return self.levels[number].make() if self.levels else self.triangles

    def uv_of(self, number: int) -> np.ndarray:
        """The places of the corners of the level of that number in the picture of its material (3 m, 2): to the right
        and down, in widths and heights of it."""
        uv = self.levels[number].uv() if self.levels else self.uv
        if uv is None or self.material is None:
            raise ValueError("a part without a picture has no places of corners in it")
        return uv * self.material.repeats


class DrawnScreen(NamedTuple):
    """A rectangle that shows a picture. ``offset`` (4, 4) in the frame of ``link``: the frame of its centre, x to the
    right and y up for a viewer in front of it; ``size``: width, height [m]; ``picture``:
    :class:`world_picture.shared_picture.PictureReader`; ``glows``: whether it is a light, whose black pixels show what
    is behind them; ``radius`` [m]: 0 for a flat one, else it is bent around y of its frame, its middle in the direction
    of z, and something solid is inside."""

    link: str
    offset: np.ndarray
    size: tuple[float, float]
    picture: PictureReader
    glows: bool = False
    radius: float = 0.0


class DrawnModel:
    """A model: its links as parts, its screens, and their poses."""

    def __init__(self, links: Sequence[tuple[str, list[DrawnPart]]], joints: Sequence[Joint],
                 screens: Sequence[DrawnScreen] = (),
                 static: bool = False, lights: Sequence[Mapping[str, Any]] = ()) -> None:
        """``links``: list of (name, parts), the roots first, then one for each ``urdf_model.Joint`` of ``joints``,
        parents first; ``static``: whether its first root is fixed in the world; ``lights``: as in the scene's entry, in
        the frames of their links.
        """
        self.screens = screens
        self._static = static
        self._lights = lights
        self._joints = joints
        self._roots = len(links) - len(joints)
        self._index = {name: number for number, (name, _) in enumerate(links)}
        self._parents = [self._index[joint.parent] for joint in joints]
        self._origins = np.array([joint.origin for joint in joints]).reshape(-1, 4, 4)
        turning = np.array([joint.type != "prismatic" for joint in joints], dtype=float)
        axes = np.array([joint.axis for joint in joints]).reshape(-1, 3)
        # v -> axis x v, as matrices, and what a prismatic joint shifts by.
        self._crosses = np.cross(np.eye(3), axes[:, None] * turning[:, None, None]).reshape(-1, 3, 3)
        self._squares, self._shifts = self._crosses @ self._crosses, axes * (1.0 - turning)[:, None]
        self.parts = [parts for _, parts in links]
        self.matrices = np.tile(np.eye(4), (len(links), 1, 1))
        self._shown = None

    @property
    def has_lights(self) -> bool:
        """Whether some of its links hold lights."""
        return bool(self._lights)

    @property
    def sizes(self) -> list[int]:
        """Numbers of this body's values in a snapshot: of the first root's pose with the joints, then of the other
        roots' poses."""
        return [7 + len(self._joints)] + [7] * (self._roots - 1)

    @property
    def size(self) -> int:
        """Number of this body's values in a snapshot."""
        return sum(self.sizes)

    @property
    def link_names(self) -> list[str]:
        """The names of the links, parents first, as in ``parts`` and ``matrices``."""
        return list(self._index)

    @property
    def joint_names(self) -> list[str]:
        """The names of the joints, in the snapshot's order."""
        return [joint.name for joint in self._joints]

    def set_state(self, values: np.ndarray) -> bool:
        """Set the poses of all links from ``values``, in the snapshot's order. Returns whether anything has moved."""
        if self._shown is not None and np.array_equal(values, self._shown):
            return False
        self._shown = values.copy()
        end = 7 + len(self._joints)
        poses = (values[:7], *values[end:].reshape(-1, 7))
        for number, pose in enumerate(poses):
            self.matrices[number] = rigid(matrix_from_quaternion(pose[3:]), pose[:3])
        steps = self._steps(values[7:end])
        for number, (parent, step) in enumerate(zip(self._parents, steps, strict=True), self._roots):
            np.dot(self.matrices[parent], step, out=self.matrices[number])
        return True

    def _steps(self, positions):
        """Poses (n, 4, 4) of the joints' children in their parents, at ``positions`` (n,) [rad or m]: all at once, by
        Rodrigues' formula."""
        sines, cosines = np.sin(positions)[:, None, None], np.cos(positions)[:, None, None]
        motions = np.zeros((len(positions), 4, 4))
        motions[:, :3, :3] = np.eye(3) + sines * self._crosses + (1.0 - cosines) * self._squares
        motions[:, :3, 3] = self._shifts * positions[:, None]
        motions[:, 3, 3] = 1.0
        return self._origins @ motions

    def moved(self, positions: Mapping[str, float]) -> dict[int, np.ndarray]:
        """Poses in the world if the joints ``positions`` {name: [rad or m]} stood there, and the others as shown.

        Returns {link's number: pose (4, 4)} of the links that these joints move. Any thread may call it.
        """
        matrices, found = self.matrices.copy(), {}
        shown = np.zeros(self.size) if self._shown is None else self._shown
        steps = self._steps(np.array([positions.get(joint.name, value)
                                      for joint, value in zip(self._joints, shown[7:7 + len(self._joints)],
                                                              strict=True)]))
        for number, (joint, parent) in enumerate(zip(self._joints, self._parents, strict=True), self._roots):
            if joint.name in positions or parent in found:
                found[number] = matrices[number] = matrices[parent] @ steps[number - self._roots]
        return found

    def is_fixed(self, name: str) -> bool:
        """Whether a body link is fixed in the world; ``KeyError`` for an unknown one."""
        return self._static and self._index[name] == 0

    def lights(self) -> list[dict[str, Any]]:
        """The lights in its links, as the scene lists those of the world."""
        return [{**light, "place": (matrix[:3, :3] @ light["place"] + matrix[:3, 3]).tolist(),
                 "direction": (matrix[:3, :3] @ light["direction"]).tolist()}
                for light in self._lights for matrix in [self.link_matrix(light["link"])]]

    def link_matrix(self, name: str) -> np.ndarray:
        """Pose (4, 4) of a body link's frame in the world; ``KeyError`` for an unknown one."""
        return self.matrices[self._index[name]]


class _Built(NamedTuple):
    """A body and the entry of the scene that it was made of; the same ``key`` means the same body. ``waits_for``: the
    keys of meshes that were not ready for it."""

    key: tuple[object, ...]
    entry: Mapping[str, Any]
    body: DrawnModel
    waits_for: frozenset[str]


class Mirror:
    """All bodies of the world."""

    def __init__(self, drawings: DrawingCache, find_mesh: Callable[[str], str | None],
                 warn: Callable[[str], object]) -> None:
        """``drawings``: a ``world_picture.drawing.DrawingCache``, or a ``world_picture.background.BackgroundDrawings``,
        with which meshes may appear later, and collision shapes stand in for them; ``find_mesh(uri)`` -> path or None;
        ``warn(text)``."""
        self._drawings = drawings
        self._collisions = MeshCache()
        self._find_mesh = find_mesh
        self._warn = warn
        self._warned = set()  # names of pictures
        self._parts = {}
        self._bodies = {}  # of _Built
        self._not_ready = set()  # keys, while a body is being built
        #: Names of the models whose meshes are not ready.
        self.waiting = []
        #: How many meshes and pictures are not.
        self.left = 0
        #: Bodies by name, in the scene's order.
        self.bodies = {}
        #: The light: :class:`sensor_renderer.light.SceneLight`.
        self.light = SceneLight.of_scene({})
        self._world_light = {}
        #: Counts visible changes, except pictures on screens.
        self.version = 0

    def set_scene(self, listed: Iterable[Mapping[str, Any]], light: Mapping[str, Any] | None = None) -> None:
        """Show what :meth:`world_picture.snapshot.SnapshotWriter.write_scene` lists; bodies that exist already stay."""
        self._world_light = light or {}
        known = self._bodies
        self._bodies = {}
        self._drawings.begin_scene()
        for entry in listed:
            name = entry["name"]
            key = (entry["urdf"], tuple(entry["joints"]), str(entry.get("screens")), bool(entry.get("static")),
                   str(entry.get("lights")), bool(entry.get("loose")))
            old = known.get(name)
            self._bodies[name] = old if old is not None and old.key == key else self._build(key, entry)
        self._show_bodies()
        self._forget_unused()

    def complete(self) -> None:
        """Show the models whose meshes have become ready. A state has to be set after it."""
        ready = [name for name in self.waiting if not self._drawings.is_making(self._bodies[name].waits_for)]
        if ready:
            for name in ready:
                self._bodies[name] = self._build(self._bodies[name].key, self._bodies[name].entry)
            self._show_bodies()

    def _show_bodies(self):
        self.bodies = {name: built.body for name, built in self._bodies.items()}
        self.waiting = [name for name, built in self._bodies.items() if built.waits_for]
        self.left = len(set().union(*(built.waits_for for built in self._bodies.values())))
        self._light_up()
        self.version += 1

    def _forget_unused(self):
        if len(self._parts) > MAX_UNUSED:
            used = {part.key for body in self.bodies.values() for parts in body.parts for part in parts}
            unused = [key for key in self._parts if key not in used]
            for key in unused[:max(len(unused) - MAX_UNUSED, 0)]:
                del self._parts[key]

    def set_state(self, values: np.ndarray) -> None:
        """Move all bodies to the poses in a snapshot's ``values``."""
        start, moved = 0, False
        for body in self.bodies.values():
            moved |= body.set_state(values[start:start + body.size])
            start += body.size
        self.version += moved
        if moved and any(body.has_lights for body in self.bodies.values()):
            self._light_up()

    def _light_up(self):
        lights = [light for body in self.bodies.values() for light in body.lights()]
        self.light = SceneLight.of_scene(self._world_light, lights)

    @property
    def picture_versions(self) -> tuple[int, ...]:
        """The numbers of the pictures that the screens show; one of them changes with each new picture."""
        return tuple(screen.picture.version for body in self.bodies.values() for screen in body.screens)

    def _build(self, key, entry):
        self._not_ready = set()
        body = self._body(entry)
        return _Built(key, entry, body, frozenset(self._not_ready))

    def _body(self, entry):
        if entry["urdf"] is None:
            return DrawnModel([("", [_floor()])], [], static=True)
        merged = merge_fixed(parse_urdf(entry["urdf"], source=entry["name"]), held=not entry.get("loose"))
        joints = list(merged.joints.values())
        order = [*merged.roots, *(joint.child for joint in joints)]
        links = [(name, self._parts_of_link(merged.links[name])) for name in order]
        screens = [screen for screen in map(self._screen, entry.get("screens", ())) if screen]
        return DrawnModel(links, joints, screens, bool(entry.get("static")), entry.get("lights", ()))

    def _screen(self, listed):
        try:
            picture = PictureReader(listed["picture"])
        except SnapshotError as error:
            self._warn(str(error))
            return None
        return DrawnScreen(listed["link"], np.reshape(listed["offset"], (4, 4)), tuple(listed["size"]), picture,
                           bool(listed.get("glows")), float(listed.get("radius", 0.0)))

    def _parts_of_link(self, link):
        """The parts of a link; with its collision shapes as long as meshes of it are not ready."""
        parts, missing = [], None
        for shape in link.visuals:
            try:
                parts += self._parts_of(shape)
            except NotReady as error:
                self._not_ready.add(error.key)
                missing = missing or shape
        if missing is not None:
            for shape in link.collisions:
                parts += self._stand_ins(shape, missing.colour or DEFAULT_COLOUR)
        return parts

    def _stand_ins(self, shape, colour):
        """A list of the :class:`DrawnPart` of a collision shape, in ``colour``; empty where it is a mesh that no world
        has converted yet."""
        geometry = shape.geometry
        if not isinstance(geometry, Mesh):
            return [self._placed((geometry,), lambda: _at(shape.origin, triangles.of_primitive(geometry)), shape.origin,
                                 colour=colour)]
        path = self._find_mesh(geometry.filename)
        corners = None if path is None else self._collisions.corners(path, part=(geometry.submesh, geometry.centred))
        if corners is None or not len(corners):
            return []
        origin = shape.origin @ np.diag([*geometry.scale, 1.0])
        return [self._placed(("collision", path), lambda: _at(origin, triangles.flat(corners)), origin, colour=colour)]

    def _parts_of(self, shape):
        """The list of :class:`DrawnPart` of a visual shape. Raises NotReady."""
        if shape.colour is not None and shape.colour[3] <= 0.0:
            return []  # nobody sees it
        geometry, colour, finish = shape.geometry, shape.colour or DEFAULT_COLOUR, shape.finish or Finish()
        texture = self._texture(finish.texture, self._find_mesh(finish.texture)) if finish.texture else None
        if not isinstance(geometry, Mesh):
            look = _look(finish, colour, shape.colour or _WHITE, texture, finish.emission)
            if isinstance(geometry, Box) and look["material"] is not None:
                look["uv"] = triangles.uv_on_primitive(geometry, triangles.of_primitive(geometry))
            return [self._placed((geometry,), lambda: _at(shape.origin, triangles.of_primitive(geometry)), shape.origin,
                                 levels=_round_levels(geometry, shape.origin), **look)]
        path = self._find_mesh(geometry.filename)
        if path is None:
            return []  # /gazebo has logged it
        try:
            found = self._drawings.parts(path, texture is not None, (geometry.submesh, geometry.centred))
        except DrawingError as error:
            self._warn(str(error))
            return []
        return [self._part_of_mesh(part, shape, texture, path) for part in found]

    def _part_of_mesh(self, part, shape, texture, path):
        """The :class:`DrawnPart` of a ``world_picture.drawing.MeshPart`` in the mesh file at ``path``; ``texture``: the
        picture that the description lays over it, or None."""
        colour, factor = part.colour or shape.colour or DEFAULT_COLOUR, shape.colour or _WHITE
        opacity = factor[3]
        finish = shape.finish or Finish()
        # A material that brings a picture replaces the file's own.
        emission = finish.emission if texture is not None or any(finish.emission) else part.emission
        if texture is None and part.texture:
            # Some meshes name pictures of other models.
            found = self._find_mesh(part.texture) if "://" in part.texture else None
            texture = self._texture(part.texture, found or find_texture(part.texture, Path(path).parent))
            factor = part.colour
            if texture is None and part.colour == _WHITE:
                colour = shape.colour or DEFAULT_COLOUR
        origin = shape.origin @ np.diag([*shape.geometry.scale, 1.0])
        size = float(np.linalg.norm(origin[:3, :3], axis=0).max())
        levels = tuple(DetailLevel(level.error * size, lambda path=level.path: _at(origin, _read(path)),
                                   lambda path=level.path: _uv(path))
                       for level in part.levels)
        # A mirrored mesh shows its backs; they are its outside.
        finish = replace(finish, two_sided=finish.two_sided or np.linalg.det(origin[:3, :3]) < 0.0)
        return self._placed((part.path,), levels[part.plain].make, origin, levels=levels, is_mesh=True,
                            **_look(finish, (*colour[:3], opacity), (*factor[:3], opacity), texture, emission))

    def _texture(self, name, path):
        """The ``world_picture.textures.Texture`` of the picture at ``path``, or None, with one warning."""
        try:
            if path is None:
                raise DrawingError("picture %s does not exist; what it should be on is shown in one colour" % name)
            return self._drawings.texture(path)
        except NotReady as error:
            self._not_ready.add(error.key)
            return None
        except DrawingError as error:
            if name not in self._warned:
                self._warned.add(name)
                self._warn(str(error))
            return None

    def _placed(self, what, make, origin, **look):
        key = (*what, origin.tobytes())
        if key not in self._parts:
            self._parts[key] = make()
        return DrawnPart(key, self._parts[key], **look)


def _round_levels(geometry, origin):
    """The :class:`DetailLevel` of each of ``triangles.CIRCLES`` of a Cylinder or Sphere at ``origin`` (4, 4); () of a
    Box."""
    def made(corners):
        return triangles.of_primitive(geometry, corners)

    if isinstance(geometry, Box):
        return ()
    return tuple(DetailLevel(_SLANTED * triangles.circle_error(geometry.radius, corners),
                             lambda corners=corners: _at(origin, made(corners)),
                             lambda corners=corners: triangles.uv_on_primitive(geometry, made(corners)))
                 for corners in triangles.CIRCLES)


def _look(finish, colour, factor, texture, emission):
    """Colour, gloss and material of a :class:`DrawnPart`. ``colour``: where ``texture`` is None; ``factor``: of the
    colours of the texture; the fourth number of both: the opacity."""
    gloss = GLOSS if finish.gloss is None else finish.gloss
    opacity = min(colour[3] if texture is None else factor[3], 1.0)
    if texture is not None:
        material = PartLook(texture.path, tuple(factor[:3]), tuple(emission), finish.repeats, finish.cut_out,
                            finish.two_sided, opacity)
        colour = (*(a * b for a, b in zip(texture.colour, factor, strict=False)), factor[3])
    elif any(emission) or opacity < 1.0:
        material = PartLook("", tuple(colour[:3]), tuple(emission), two_sided=opacity >= 1.0, opacity=opacity)
    else:
        material = None
    return {"colour": tuple(colour), "gloss": gloss, "material": material}


def _read(path):
    return triangles.indexed(*read_level(path))


def _uv(path):
    faces, uv = read_level(path)[2], read_uv(path)
    return np.zeros((faces.size, 2)) if uv is None else uv[faces.ravel()]


def _at(origin, rows):
    """The triangles ``rows`` (3 m, 6) at ``origin`` (4, 4), which may scale them."""
    points = rows[:, :3] @ origin[:3, :3].T + origin[:3, 3]
    normals = rows[:, 3:] @ np.linalg.inv(origin[:3, :3])
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-30)[:, None]
    return np.hstack([points, normals]).astype(np.float32)


def _floor():
    half = FLOOR_HALF_M
    corners = [(-half, -half), (half, -half), (half, half), (-half, -half), (half, half), (-half, half)]
    sheet = np.array([(x, y, 0.0, 0.0, 0.0, 1.0) for x, y in corners], dtype=np.float32)
    return DrawnPart(("floor",), sheet, FLOOR_COLOUR, is_floor=True)
