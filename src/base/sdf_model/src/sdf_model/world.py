# SPDX-License-Identifier: BSD-3-Clause
"""The <world> element: gravity, step size, models, lights."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from lxml import etree

from urdf_model import Box, Link, OutOfBounds, Robot, Shape, bounds, read_file
from urdf_model.model import is_true
from urdf_model.transforms import pose_matrix

from .document import Document, Notes, SdfError, Triple
from .folders import ModelFolders
from .frames import Frames
from .lights import Light, SceneLook, read_light, read_scene
from .model import ModelReader, SdfModel, actor, unused

# Left out, with a note.
_NAMED = ("plugin",)
#: SDF's defaults of a world: length of a step [s], gravity [m/s^2].
STEP_S, GRAVITY = 0.001, (0.0, 0.0, -9.8)
_ROAD_HEIGHT_M = 0.002
_AT_REST = 0.01  # m/s and rad/s: what Gazebo saves of bodies that stand
_ASPHALT = (0.25, 0.25, 0.25, 1.0)


@dataclass
class SdfWorld:
    """The content of a world file; what it does not give is SDF's default.

    ``problems`` are parts that cannot be used, one line each; the world is made without them. ``warning`` names what
    was not understood.
    """

    name: str
    gravity: Triple = GRAVITY  # m/s^2
    time_step_s: float = STEP_S
    models: list[SdfModel] = field(default_factory=list)
    lights: list[Light] = field(default_factory=list)
    scene: SceneLook = field(default_factory=SceneLook)
    problems: list[str] = field(default_factory=list)
    warning: str = ""


def parse_sdf_world(path: str | Path, folders: ModelFolders | None = None) -> SdfWorld:
    """Return the SdfWorld of the file at ``path``. ``folders`` (ModelFolders): where models are looked for.

    Raises SdfError when the file cannot be read or is not a world, and for numbers of the world itself that are wrong;
    what is wrong in a model is in ``SdfWorld.problems``.
    """
    try:
        content = read_file(path, bounds.WORLD_BYTES)
    except OSError as error:
        raise SdfError("world file %s cannot be read: %s" % (path, error.strerror)) from None
    document = Document(content, path, Path(path).parent, Notes(), bounds.WORLD_BYTES)
    worlds = document.root.findall("world")
    if len(worlds) != 1:
        raise document.error(document.root, "it holds %d <world>, expected one" % len(worlds))
    return _WorldReader(document, folders or ModelFolders([]), worlds[0]).world()


class _WorldReader:
    def __init__(self, document: Document, folders: ModelFolders, element: etree._Element) -> None:
        self._document = document
        self._element = element
        self._models = ModelReader(folders)
        self._frames = Frames(document)
        self._world = SdfWorld(element.get("name", "default"))

    def world(self) -> SdfWorld:
        document, element = self._document, self._element
        for child in element.iterchildren(*_NAMED):
            document.note(child, "%s '%s'" % (child.tag, child.get("filename") or child.get("name", "")))
        if element.find("gravity") is not None:
            self._world.gravity = self._gravity(element)
        profiles = list(element.iterchildren("physics"))
        for child in [one for one in profiles if is_true(one.get("default"))][:1] or profiles[:1]:
            self._physics(child)
        for child in element.iterchildren("scene"):
            self._world.scene = read_scene(document, child)
        for child in element.iterchildren("frame"):
            self._frames.add(document.name(child), child, child.get("attached_to", ""))
        for child in document.children(element):
            if child.tag in ("include", "model", "light", "road", "actor"):
                try:
                    self._entity(child)
                except SdfError as error:
                    self._world.problems.append(str(error))
        for state in element.iterchildren("state"):
            self._state(state)
        self._world.warning = document.notes.warning()
        return self._world

    def _physics(self, element: etree._Element) -> None:
        document = self._document
        step = element.find("max_step_size")
        if step is not None:
            value = document.number(element, "max_step_size", STEP_S)
            used = min(max(value, bounds.TIME_STEP.low), bounds.TIME_STEP.high)
            if used != value:
                document.mend(step, "<max_step_size> of %g s, for which %g s is used" % (value, used))
            self._world.time_step_s = used
        if element.find("gravity") is not None:  # where older files have it
            self._world.gravity = self._gravity(element)

    def _gravity(self, element: etree._Element) -> Triple:
        return self._bounded(bounds.GRAVITY, self._document.vector(element, "gravity", GRAVITY),
                             element.find("gravity"))

    def _bounded(self, bound: bounds.Bound, values: Triple, element: etree._Element) -> Triple:
        try:
            return bound.check(values, "<%s>" % element.tag)
        except OutOfBounds as error:
            raise self._document.error(element, str(error)) from None

    def _entity(self, element: etree._Element) -> None:
        document, world = self._document, self._world
        if element.tag == "light":
            world.lights.append(read_light(document, element, np.eye(4)))
            return
        if element.tag == "road":
            model = _road(document, element)
        elif element.tag == "model":
            model = self._models.model(document, element)
        elif element.tag == "actor":
            model = actor(document, element)
        else:
            model = self._models.included(document, element, 0)
            if isinstance(model, SdfModel) and not document.text(element, "name", ""):
                model.name = model.robot.name = unused(model.name, {other.name for other in world.models})
        if not isinstance(model, SdfModel):
            world.lights += model.lights
            return
        if any(other.name == model.name for other in world.models):
            raise document.error(element, "model '%s' appears twice; give this one another <name>" % model.name)
        model.pose = self._frames.where(document.relative_to(element), element) @ model.pose
        self._frames.add(model.name, element, pose=model.pose)
        world.models.append(model)

    def _state(self, element: etree._Element) -> None:
        """A world saved by Gazebo has two poses of each model and light; <state> has the last one."""
        lights = {light.name: light for light in self._world.lights}
        for child in element.iterchildren("light"):
            if child.find("pose") is not None and child.get("name") in lights:
                lights[child.get("name")].pose = self._document.pose(child)
        poses = {child.get("name"): child for child in element.iterchildren("model")}
        for model in self._world.models:
            child = poses.get(model.name)
            if child is None:
                continue
            if child.find("pose") is not None:
                model.pose = self._document.pose(child)
            links = list(child.iterchildren("link"))
            if links and model.robot.movable_joints():
                self._document.note(links[0], "joint positions of model '%s' in <state>" % model.name)
            if any(np.abs(self._document.vector(link, "velocity", (0.0,) * 6)).max() > _AT_REST for link in links):
                self._document.note(links[0], "velocities of model '%s' in <state>" % model.name)


def _road(document: Document, element: etree._Element) -> SdfModel:
    """Return the SdfModel of a <road>: visible, without collisions."""
    width = document.number(element, "width", 1.0)
    points = [np.array(document.numbers(point, 3)) for point in element.iterchildren("point")]
    if len(points) < 2 or not width > 0.0:
        raise document.error(element, "<road> has %d points and a width of %g m; expected two points and more, and a "
                             "width above 0" % (len(points), width))
    link = Link("link", line=element.sourceline)
    for number, (start, end) in enumerate(zip(points, points[1:], strict=False)):
        along = end - start
        length = float(np.linalg.norm(along))
        if length < 1e-6:
            continue
        pitch, yaw = -np.arctan2(along[2], np.hypot(along[0], along[1])), np.arctan2(along[1], along[0])
        place = pose_matrix((start + end) / 2.0, (0.0, float(pitch), float(yaw)))
        link.visuals.append(Shape(Box((length, width, _ROAD_HEIGHT_M)), place, "part%d" % number, _ASPHALT, "link"))
    name = element.get("name") or "road"
    robot = Robot(name, {"link": link}, {}, "link")
    said = etree.Element("gazebo")
    etree.SubElement(said, "static").text = "true"
    robot.gazebo.append(said)
    return SdfModel(name, robot, np.eye(4), True)
