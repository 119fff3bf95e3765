# SPDX-License-Identifier: BSD-3-Clause
"""Links as vertex arrays, in levels of detail, and which of them a camera sees. ROS-free."""
from __future__ import annotations

import bisect
import weakref
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple, TypeVar

import numpy as np

from sensor_renderer.mirror import MAX_UNUSED
from sensor_renderer.sides import indexed
from world_picture.reduction import reduced
from world_picture.results import ResultCache

if TYPE_CHECKING:
    import moderngl

    from sensor_renderer.mirror import DrawnPart, Mirror, PartLook
    from sensor_renderer.pinhole import Pinhole
    from sensor_renderer.programs import Programs
    from sensor_renderer.sides import Sides

# How far the drawn surface of a link may be from its original, in pixels of the picture: a whole one in a live picture
# of colour, where the half of it would cost a tenth more. In pictures of depth, whose values are compared with
# millimetres, also in metres.
_FINE_PX, _LIVE_PX = 0.5, 1.0
_MAX_IN_DEPTH_M = 0.001
# Share of the plain triangles that casts a mesh's shadow, and how many at least: half of the cost of a picture would
# be its shadow map. In pictures that may take their time, how far what casts shadows may be from the original.
_CASTER_SHARE, _CASTER_MIN = 0.2, 60
_CASTER_M = 0.003
# DrawnPart of the names of cached results: increase it when other triangles cast shadows or show their backs.
_VERSION = 1
Entry = TypeVar("Entry")


@dataclass
class DrawnLink:
    """The geometry of one draw call: a bounding box, by its centre (3,) and half of its size (3,), and the radius of a
    sphere about the same centre [m]; its parts; whether it has meshes; the array that casts its
    shadow. :class:`Arrays` are made of a level of detail when it is first needed, by the numbers of the parts' levels;
    ``by_step`` finds them by the number of :attr:`steps` that a camera does not see."""

    centre: np.ndarray
    half: np.ndarray
    radius: float
    is_floor: bool
    parts: tuple[DrawnPart, ...] = ()
    is_mesh: bool = False
    caster: VertexArray | None = None
    by_level: dict[tuple[int, ...], Arrays] = field(default_factory=dict)
    by_step: dict[int, Arrays] = field(default_factory=dict)

    @cached_property
    def steps(self) -> list[float]:
        """The distances from the original [m] of all parts' levels, in order: between two of them the levels to draw
        are the same."""
        return sorted({level.error_m for part in self.parts for level in part.levels})


class Arrays(NamedTuple):
    """Vertex arrays of a level of detail, for ``colour`` and for ``depth`` only; how many ``corners`` has the former
    without the backs that follow. ``textured``: (:class:`sensor_renderer.mirror.PartLook`, vertex array) for each
    material; ``colour`` is of the parts without one, or None."""

    colour: VertexArray | None
    depth: VertexArray
    corners: int = -1
    textured: tuple[tuple[PartLook, VertexArray], ...] = ()


class VertexArray:
    """A vertex array with its buffers, which it does not release by itself; ``vertices``: the number of corners."""

    def __init__(self, array: moderngl.VertexArray, buffers: Iterable[moderngl.Buffer]) -> None:
        self.render, self.vertices = array.render, array.vertices
        self._held = array, *buffers

    def release(self) -> None:
        """Give back their memory."""
        for held in self._held:
            held.release()


class Links:
    """The vertex arrays of one context, one set for each different link."""

    def __init__(self, context: moderngl.Context, programs: Programs, live: bool, sides: Sides | None = None) -> None:
        """``programs``: :class:`sensor_renderer.programs.Programs`; ``live``: for pictures at a camera's rate, whose
        meshes are coarser and cast the shadows of even fewer triangles; ``sides``:
        :class:`sensor_renderer.sides.Sides` if meshes are to be drawn from the front, None if from both sides."""
        self._context = context
        self._sides = sides
        self._live = live
        self._programs = programs
        self._results = ResultCache()
        self._links = {}
        self._links_of = weakref.WeakKeyDictionary()

    def clear(self) -> None:
        """Release all arrays."""
        for link in self._links.values():
            _release(link)
        self._links = {}
        self._links_of.clear()

    def everything(self, mirror: Mirror) -> list[tuple[DrawnLink, np.ndarray, np.ndarray]]:
        """The links to draw: (:class:`DrawnLink`, matrix, the same as OpenGL reads it), one for each link that has
        shapes."""
        found = []
        for body in mirror.bodies.values():
            found += [entry for entry in self._of(body) if entry[0] is not None]
        return found

    def named(self, mirror: Mirror) -> list[tuple[DrawnLink, np.ndarray, tuple[tuple[str, int], np.ndarray]]]:
        """The same, with ((model's name, link's number), the packed matrix) in place of the packed matrix."""
        return [(link, matrix, ((name, number), packed)) for name, body in mirror.bodies.items()
                for number, (link, matrix, packed) in enumerate(self._of(body)) if link is not None]

    def _of(self, body):
        links = self._links_of.get(body)
        if links is None:
            self._forget_unused()
            links = self._links_of[body] = [self._link(parts) if parts else None for parts in body.parts]
        packed = np.ascontiguousarray(body.matrices.transpose(0, 2, 1), dtype=np.float32)
        return zip(links, body.matrices, packed, strict=True)

    def _forget_unused(self):
        """Release the links of models that are gone, if they are many: with other sizes or colours, each was another
        one. A few stay, for models that come again."""
        if len(self._links) <= MAX_UNUSED:
            return
        used = {id(link) for links in self._links_of.values() for link in links}
        unused = [key for key, link in self._links.items() if id(link) not in used]
        for key in unused[:max(len(unused) - MAX_UNUSED, 0)]:
            _release(self._links.pop(key))

    def prepare(self, mirror: Mirror) -> None:
        """Make all levels of detail of all links."""
        for link, _, _ in self.everything(mirror):
            for error_m in (0.0, *link.steps):
                self._level(link, error_m)

    def arrays(self, link: DrawnLink, distance: float, pinhole: Pinhole, depth: bool = False) -> Arrays:
        """The :class:`Arrays` of the level of detail that the ``distance`` of the link's sphere asks for; finer ones
        for a picture of ``depth``."""
        error_m = (_LIVE_PX if self._live and not depth else _FINE_PX) * max(distance, pinhole.near) / pinhole.fx
        return self._level(link, min(error_m, _MAX_IN_DEPTH_M) if depth else error_m)

    def _level(self, link, error_m):
        step = bisect.bisect_right(link.steps, error_m)
        found = link.by_step.get(step)
        if found is None:
            numbers = tuple(part.level(error_m) for part in link.parts)
            found = link.by_level.get(numbers)
            if found is None:
                found = link.by_level[numbers] = self._arrays_of(link, numbers)
            link.by_step[step] = found
        return found

    def _link(self, parts):
        key = tuple((part.key, part.colour, part.gloss, part.material) for part in parts)
        found = self._links.get(key)
        if found is None:
            rows = _rows(parts, [part.triangles for part in parts])
            low, high = rows[:, :3].min(axis=0), rows[:, :3].max(axis=0)
            centre = (low + high) / 2.0
            # A level may be as far outside of this one.
            error_m = max((level.error_m for part in parts for level in part.levels), default=0.0)
            radius = float(np.linalg.norm(rows[:, :3] - centre, axis=1).max()) + error_m
            found = self._links[key] = DrawnLink(centre, (high - low) / 2.0 + error_m, radius,
                                                 any(part.is_floor for part in parts), tuple(parts),
                                                 any(part.is_mesh for part in parts))
            found.caster = self._caster_of(found)
        return found

    def _arrays_of(self, link, numbers):
        """The :class:`Arrays` of ``link``, with the levels of its parts by their ``numbers``."""
        levels = [(part, number, part.triangles_of(number)) for part, number in zip(link.parts, numbers, strict=True)]
        positions = np.concatenate([rows[:, :3] for _, _, rows in levels])
        depth = self._vertex_array(self._programs.shadow, positions, "3f", "position")
        if link.is_floor:
            return Arrays(None, depth)  # :class:`sensor_renderer.floor.Floor` draws it
        textured = self._textured([level for level in levels if level[0].material is not None])
        plain = [(part, rows) for part, _, rows in levels if part.material is None]
        if not plain:
            return Arrays(None, depth, textured=textured)
        rows = _rows(*zip(*plain, strict=True))
        program = self._programs.mesh if link.is_mesh else self._programs.solid
        colour = self._vertex_array(program, rows, "3f 3f 4f", "position", "normal", "colour",
                                    backs=self._backs(rows, link, "from_behind") if link.is_mesh else ())
        return Arrays(colour, depth, len(rows), textured)

    def _textured(self, levels):
        """One array for each material; ``levels``: (part, number of its level, triangles)."""
        alike = {}
        for part, number, rows in levels:
            alike.setdefault(part.material, []).append(np.hstack([_rows([part], [rows]), part.uv_of(number)]))
        return tuple((material, self._vertex_array(self._programs.textured(), np.concatenate(rows).astype(np.float32),
                                                   "3f 3f 4f 2f", "position", "normal", "colour", "uv"))
                     for material, rows in alike.items())

    def _backs(self, rows, link, which):
        """The corners of the triangles of ``link`` that show their backs, in the order that makes these fronts.
        ``which``: the name of the method of :class:`sensor_renderer.sides.Sides` that finds them."""
        if self._sides is None:
            return ()
        # It takes up to a tenth of a second, and a camera waits.
        looked_at = rows[:, :3], link.centre, link.radius
        behind = self._results.array("%s-%d" % (which, _VERSION), looked_at,
                                     lambda: getattr(self._sides, which)(*looked_at))
        return np.arange(len(rows)).reshape(-1, 3)[behind, ::-1].ravel()

    def _caster_of(self, link):
        """The array that casts the shadow of ``link``; None for floors, and for what one can see through."""
        opaque = [part for part in link.parts if not part.is_floor and (part.material is None
                                                                        or part.material.opacity >= 1.0)]
        if not opaque:
            return None
        if not (link.is_mesh and self._live):
            if len(opaque) == len(link.parts):
                return self._level(link, _CASTER_M).depth
            rows = np.concatenate([part.triangles_of(part.level(_CASTER_M))[:, :3] for part in opaque])
            return self._vertex_array(self._programs.shadow, rows, "3f", "position")
        rows = _rows(opaque, [part.triangles for part in opaque])
        rows = self._results.array("caster-%d" % _VERSION, (rows[:, :3],), lambda: _thinned(rows))
        return self._vertex_array(self._programs.shadow, rows, "3f", "position",
                                  backs=self._backs(rows, link, "plainly_from_behind"))

    def _vertex_array(self, program, rows, layout, *names, backs=()):
        """Of the corners ``rows``, and after them those numbered ``backs`` again. The GPU processes shared vertices
        once."""
        unique, index = indexed(rows)
        index = np.concatenate((index, index[np.asarray(backs, dtype=int)])).astype(np.int32)
        buffers = self._context.buffer(unique.tobytes()), self._context.buffer(index.tobytes())
        return VertexArray(self._context.vertex_array(program, [(buffers[0], layout, *names)], buffers[1]), buffers)


def _release(link):
    """Release all arrays of a :class:`DrawnLink`."""
    arrays = link.by_level.values()
    textured = (array for level in arrays for _, array in level.textured)
    for array in {link.caster, *textured, *(array for level in arrays for array in level[:2])}:
        if array is not None:
            array.release()


def _thinned(rows):
    """The corners (3 m, 3) of the triangles that cast the shadow of a mesh."""
    faces = np.arange(len(rows)).reshape(-1, 3)
    vertices, faces = reduced(rows[:, :3].astype(float), faces, max(_CASTER_MIN, round(_CASTER_SHARE * len(faces))))
    return vertices[faces].reshape(-1, 3).astype(np.float32)


def _rows(parts, triangles):
    """(n, 10) position, normal, colour and gloss of the corners of all parts. One call draws a link: in software a call
    costs as much as some hundred triangles."""
    return np.concatenate([np.hstack([rows, np.tile(np.array([*_factor(part), part.gloss], np.float32),
                                                    (len(rows), 1))])
                           for part, rows in zip(parts, triangles, strict=True)])


def _factor(part):
    return part.material.factor if part.material is not None else part.colour[:3]


def visible(listed: Sequence[tuple[DrawnLink, np.ndarray, Entry]], pinhole: Pinhole,
            view: np.ndarray) -> list[tuple[DrawnLink, np.ndarray, Entry, float]]:
    """The entries of ``listed``, (:class:`DrawnLink`, matrix, anything), whose boxes and spheres intersect the view
    frustum, near ones first; each with the distance of the sphere from the eye [m], negative inside."""
    # Outward normals of the four sides, in the optical frame; all go through the eye.
    left, right = -(pinhole.cx + 0.5) / pinhole.fx, (pinhole.width - 0.5 - pinhole.cx) / pinhole.fx
    top, bottom = -(pinhole.cy + 0.5) / pinhole.fy, (pinhole.height - 0.5 - pinhole.cy) / pinhole.fy
    sides = np.array([(-1.0, 0.0, left), (1.0, 0.0, -right), (0.0, -1.0, top), (0.0, 1.0, -bottom)])
    sides /= np.linalg.norm(sides, axis=1)[:, None]
    if not listed:
        return []
    matrices = np.array([matrix for _, matrix, _ in listed])
    centres = np.array([link.centre for link, _, _ in listed])
    radii = np.array([link.radius for link, _, _ in listed])
    world = np.einsum("nij,nj->ni", matrices[:, :3, :3], centres) + matrices[:, :3, 3]
    local = world @ view[:3, :3].T + view[:3, 3]
    # How far a box extends from its centre towards each side, and along z.
    axes = np.vstack((sides, (0.0, 0.0, 1.0))) @ view[:3, :3]
    halves = np.array([link.half for link, _, _ in listed])
    extents = np.einsum("nkj,nj->nk", np.abs(axes @ matrices[:, :3, :3]), halves)
    extents = np.minimum(extents, radii[:, None])
    inside = (local @ sides.T < extents[:, :4]).all(axis=1)
    inside &= (local[:, 2] > pinhole.near - extents[:, 4]) & (local[:, 2] < pinhole.far + extents[:, 4])
    # Near ones first: hidden pixels are not shaded.
    order = np.argsort(local[:, 2] - radii, kind="stable")
    distances = np.linalg.norm(local, axis=1) - radii
    return [(*listed[k], float(distances[k])) for k in order if inside[k]]
