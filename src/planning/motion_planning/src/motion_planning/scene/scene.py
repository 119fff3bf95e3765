# SPDX-License-Identifier: BSD-3-Clause
"""The planning scene as an immutable snapshot, with MoveIt's meaning of each change."""
from __future__ import annotations

import difflib
import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, cast

import numpy as np

from command_line.options import counted
from motion_planning.model import PlanningModel, State
from motion_planning.scene.allowed import AllowedCollisions
from motion_planning.scene.objects import OCTOMAP, AttachedBody, SceneError, WorldObject
from urdf_model.transforms import inverse

if TYPE_CHECKING:
    from motion_planning.shapes import Octree

# Number of known names that are compared with an unknown one.
_COMPARED = 300
_MAPPINGS = ("objects", "colours", "transforms", "link_padding", "link_scale")


@dataclass(frozen=True, eq=False)
class Scene:
    """A snapshot: every change returns a new scene and does not modify this one, so threads can share it.

    objects: {id: WorldObject}, in the order of insertion. state: State, including attached objects.
    allowed: AllowedCollisions, the SRDF's at first. colours: {id: (r, g, b, a)}. octomap: WorldObject of one Octree, id
    OCTOMAP, or None. transforms: {frame: pose (4, 4) in the planning frame}, additional fixed frames.
    link_padding: {link: m} added to its collision shapes all around; link_scale: {link: factor}.
    """

    model: PlanningModel
    state: State = cast(State, None)
    objects: Mapping[str, WorldObject] = field(default_factory=dict)
    allowed: AllowedCollisions = cast(AllowedCollisions, None)
    colours: Mapping[str, Sequence[float]] = field(default_factory=dict)
    octomap: WorldObject | None = None
    transforms: Mapping[str, np.ndarray] = field(default_factory=dict)
    link_padding: Mapping[str, float] = field(default_factory=dict)
    link_scale: Mapping[str, float] = field(default_factory=dict)
    name: str = ""

    def __post_init__(self) -> None:
        if self.state is None:
            object.__setattr__(self, "state", self.model.default_state())
        if self.allowed is None:
            object.__setattr__(self, "allowed", AllowedCollisions.of(self.model))
        for name in _MAPPINGS:
            if not isinstance(getattr(self, name), MappingProxyType):
                object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))

    # -- objects of the world -----------------------------------------------------------------------------------

    def with_object(self, new: WorldObject) -> Scene:
        """Return the scene with a WorldObject added; one of the same id is replaced. Raises SceneError."""
        return self.with_objects([new])

    def with_objects(self, new: Iterable[WorldObject]) -> Scene:
        """Return the scene with many WorldObjects added at once. Raises SceneError for one without shapes or name."""
        objects = dict(self.objects)
        for one in new:
            check_object(one)
            objects[one.id] = one
        return replace(self, objects=objects)

    def appended(self, more: WorldObject) -> Scene:
        """Return the scene with the shapes of ``more`` (WorldObject) added to the object of its id, or to a new one.
        Raises SceneError."""
        there = self.objects.get(more.id)
        return self.with_object(more if there is None else there.with_shapes_of(more))

    def without_object(self, name: str) -> Scene:
        """Return the scene without an object and its colour; an empty ``name``: without all objects. What it may touch
        stays, for an object that takes the name again. Raises SceneError for an unknown name.
        """
        if not name:
            return self._without(list(self.objects))
        self._object(name)
        return self._without([name])

    def without_objects(self, names: Iterable[str]) -> Scene:
        """Return the scene without many objects; unknown names are ignored."""
        return self._without(names)

    def moved(self, name: str, pose: np.ndarray, shape_poses: Sequence[np.ndarray] | None = None) -> Scene:
        """Return the scene with an object at ``pose`` (4, 4), and its shapes at ``shape_poses`` [(4, 4), ...] in it if
        given. Raises SceneError for an unknown object, and for another number of shapes."""
        there = self._object(name)
        if shape_poses is not None:
            if len(shape_poses) != len(there.shapes):
                raise SceneError("object '%s' has %s, but %s were given to move them to"
                                 % (name, counted(len(there.shapes), "shape"), counted(len(shape_poses), "pose")))
            shapes = tuple((shape, pose) for (shape, _), pose in zip(there.shapes, shape_poses, strict=True))
            there = replace(there, shapes=shapes)
        return replace(self, objects={**self.objects, name: there.at(pose)})

    def with_octomap(self, octree: Octree | None, pose: np.ndarray | None = None) -> Scene:
        """Return the scene with ``octree`` (Octree) at ``pose`` (4, 4) as its octomap; None: with none."""
        octomap = None if octree is None else WorldObject(
            OCTOMAP, np.eye(4) if pose is None else pose, ((octree, np.eye(4)),))
        return replace(self, octomap=octomap)

    # -- attached objects -----------------------------------------------------------------------------------

    def attach(self, what: str | WorldObject, link: str, touch_links: Iterable[str] = (),
               detach_posture: object = None) -> Scene:
        """Return the scene with ``what`` attached to ``link``.

        ``what``: id of an object of the world, which is removed from the world and keeps its pose; or a WorldObject
        with its pose in the link, which replaces any object of its id there and in the world. Raises SceneError for an
        unknown link or object, and for an object without shapes.
        """
        if link not in self.model.link_index:
            raise SceneError("object cannot be attached to '%s': the robot has no such link%s"
                             % (link, like(link, self.model.links)))
        if isinstance(what, WorldObject):
            _check_name(what.id)
            if not what.shapes:
                raise SceneError("object '%s' has no shapes to attach" % what.id)
            new = what
        else:
            _check_name(what)
            new = self._take(what, link)
        body = AttachedBody(new, link, frozenset(touch_links), detach_posture)
        objects = {name: one for name, one in self.objects.items() if name != new.id}
        return replace(self, objects=objects, state=self.state.with_attached({**self.state.attached, new.id: body}))

    def attach_more(self, more: WorldObject, link: str) -> Scene:
        """Return the scene with the shapes of ``more`` (WorldObject, pose in ``link``) added to the attached object of
        its id. Raises SceneError if there is none, or another link holds it."""
        there = self._attached(more.id)
        if there.link != link:
            raise SceneError("object '%s' is held by '%s', not by '%s'" % (more.id, there.link, link))
        body = replace(there, object=there.object.with_shapes_of(more))
        return replace(self, state=self.state.with_attached({**self.state.attached, more.id: body}))

    def detach(self, name: str = "", link: str = "") -> Scene:
        """Return the scene with attached objects back in the world, at their present poses.

        Empty ``name``: all objects of ``link``; both empty: all. If the world already has an object of that name, this
        one is dropped. Raises SceneError if the robot does not hold it.
        """
        names = [name] if name else [one for one, body in self.state.attached.items() if link in ("", body.link)]
        held, objects = dict(self.state.attached), dict(self.objects)
        for one in names:
            body = self._attached(one)
            if link and body.link != link:
                raise SceneError("object '%s' is held by '%s', not by '%s'" % (one, body.link, link))
            del held[one]
            objects.setdefault(one, body.object.at(self.attached_pose(body)))
        return replace(self, objects=objects, state=self.state.with_attached(held))

    def attached_pose(self, body: AttachedBody, frames: np.ndarray | None = None) -> np.ndarray:
        """Return the pose (4, 4) of an AttachedBody's object in the planning frame.

        ``frames`` (l, 4, 4): the links', None: those of the scene's state.
        """
        frames = self.link_frames if frames is None else frames
        return frames[self.model.link_index[body.link]] @ body.object.pose

    # -- the rest -----------------------------------------------------------------------------------------------

    def with_state(self, state: State) -> Scene:
        """Return the scene with the robot in another State, including its attached objects."""
        return replace(self, state=state)

    def with_allowed(self, allowed: AllowedCollisions) -> Scene:
        """Return the scene with other AllowedCollisions."""
        return replace(self, allowed=allowed)

    def with_colours(self, colours: Mapping[str, Sequence[float]]) -> Scene:
        """Return the scene with {id: (r, g, b, a)} added to its colours."""
        return replace(self, colours={**self.colours, **colours})

    def with_transforms(self, transforms: Mapping[str, np.ndarray]) -> Scene:
        """Return the scene with {frame: pose (4, 4) in the planning frame} as its fixed frames."""
        return replace(self, transforms=transforms)

    def with_padding(self, padding: Mapping[str, float] | None = None,
                     scale: Mapping[str, float] | None = None) -> Scene:
        """Return the scene with {link: m} and {link: factor} merged into the present ones. Raises SceneError."""
        for what, table, least in (("padding", padding or {}, 0.0), ("scale", scale or {}, 1e-6)):
            for link, value in table.items():
                if link not in self.model.link_index:
                    raise SceneError("%s of link '%s': the robot has no such link%s"
                                     % (what, link, like(link, self.model.links)))
                if not (np.isfinite(value) and value >= least):
                    raise SceneError("%s of link '%s' is %s; expected %s" % (
                        what, link, value, "0 or more" if what == "padding" else "more than 0"))
        return replace(self, link_padding={**self.link_padding, **(padding or {})},
                       link_scale={**self.link_scale, **(scale or {})})

    @cached_property
    def link_frames(self) -> np.ndarray:
        """Poses (l, 4, 4) of the model's links in the planning frame, at the scene's state."""
        return self.model.frames(self.state.q, self.state.base)

    def frame(self, name: str) -> np.ndarray:
        """Return the pose (4, 4) in the planning frame of a link, of an attached object, of an object, of
        "object/subframe", or of a fixed frame; in this order. Raises SceneError for an unknown name."""
        name = name.lstrip("/")
        pose = self._known_pose(name)
        if pose is None:
            raise SceneError("'%s' is not a frame: neither a link, nor an object of the scene or a subframe of one%s"
                             % (name, like(name, self.frame_names())))
        return np.array(pose)

    def has_frame(self, name: str) -> bool:
        """Whether :meth:`frame` accepts ``name``."""
        return self._known_pose(name.lstrip("/")) is not None

    def frame_names(self) -> list[str]:
        """A new list of all names that :meth:`frame` accepts."""
        held = {name: body.object for name, body in self.state.attached.items()}
        return [self.model.frame, *self.model.links,
                *(name for things in (held, self.objects) for name in things),
                *("%s/%s" % (name, subframe) for things in (held, self.objects) for name, one in things.items()
                  for subframe in one.subframes), *self.transforms]

    def _known_pose(self, name: str) -> np.ndarray | None:
        pose = self._pose_of(name)
        if pose is None and "/" in name:
            owner, _, subframe = name.rpartition("/")
            holder = self.state.attached[owner].object if owner in self.state.attached else self.objects.get(owner)
            if holder is not None and subframe in holder.subframes:
                pose = self._pose_of(owner) @ holder.subframes[subframe]
        return self.transforms.get(name) if pose is None else pose

    def _pose_of(self, name: str) -> np.ndarray | None:
        if name in self.model.link_index:
            return self.link_frames[self.model.link_index[name]]
        if name == self.model.frame:
            return np.eye(4)
        if name in self.state.attached:
            return self.attached_pose(self.state.attached[name])
        return self.objects[name].pose if name in self.objects else None

    def _take(self, name: str, link: str) -> WorldObject:
        if name in self.objects:
            there = self.objects[name]
            return there.at(inverse(self.frame(link)) @ there.pose)
        if name in self.state.attached:  # from one hand to the other
            body = self.state.attached[name]
            return body.object.at(inverse(self.frame(link)) @ self.attached_pose(body))
        raise SceneError("object '%s' cannot be attached to '%s': it comes without geometry, and the world has no such "
                         "object%s" % (name, link, like(name, self.objects)))

    def _without(self, names: Iterable[str]) -> Scene:
        gone = set(names)
        return replace(self, objects={name: one for name, one in self.objects.items() if name not in gone},
                       colours={name: colour for name, colour in self.colours.items() if name not in gone})

    def _object(self, name: str) -> WorldObject:
        if name not in self.objects:
            raise SceneError("the world has no object '%s'%s" % (name, like(name, self.objects)))
        return self.objects[name]

    def _attached(self, name: str) -> AttachedBody:
        if name not in self.state.attached:
            raise SceneError("the robot holds no object '%s'%s" % (name, like(name, self.state.attached)))
        return self.state.attached[name]


def check_object(new: WorldObject) -> None:
    """Raise SceneError for a WorldObject that a scene does not accept."""
    _check_name(new.id)
    if not new.shapes:
        raise SceneError("object '%s' has no shapes; give it a primitive, a mesh or a plane" % new.id)


def _check_name(name: str) -> None:
    if name == OCTOMAP:
        raise SceneError("'%s' is the octomap's name; give the object another" % OCTOMAP)
    if not name:
        raise SceneError("an object has no name; give it an id")


def like(name: str, known: Iterable[str]) -> str:
    """The end of a sentence: the most similar of the ``known`` names, if any. Only the first ones are compared, because
    a message may have thousands of wrong names."""
    near = difflib.get_close_matches(name, list(itertools.islice(known, _COMPARED)), 1)
    return "; did you mean '%s'?" % near[0] if near else ""
