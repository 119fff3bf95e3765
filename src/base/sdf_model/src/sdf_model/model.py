# SPDX-License-Identifier: BSD-3-Clause
"""The <model> element, and files that hold one."""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from lxml import etree

from urdf_model import Gear, Limit, OutOfBounds, Robot, bounds, check_robot, read_file

from .actors import actor_robot
from .document import Document, Notes, SdfError
from .folders import ModelFolders
from .frames import Frames
from .gears import Gearbox
from .lights import Light, read_light
from .links import read_link
from .materials import MaterialScripts
from .tree import Dynamics, ModelParts, SdfJoint, build_robot, crosses

if TYPE_CHECKING:
    from collections.abc import Collection

_MOVABLE = ("revolute", "continuous", "prismatic")
_TWO_AXES = ("universal", "revolute2")
_DEEPEST_INCLUDE = 8


@dataclass
class SdfModel:
    """A model: its Robot, its pose (4x4) in its parent, and a warning about what was not understood."""

    name: str
    robot: Robot
    pose: np.ndarray
    static: bool
    warning: str = ""


def parse_sdf_model(xml: str | bytes, source: str | Path, folders: ModelFolders | None = None,
                    folder: str | Path | None = None) -> SdfModel:
    """Return the SdfModel of an SDF text (str or bytes) with one <model>, or with one <include> of a model.

    ``source`` names the text in messages, ``folders`` (ModelFolders) is where included models are looked for, and
    ``folder`` is what relative file names refer to. ``SdfModel.warning`` names what was not understood.
    Raises SdfError for what cannot be used.
    """
    document = Document(xml, source, folder, Notes())
    reader = ModelReader(folders or ModelFolders([]))
    found = [child for child in document.children(document.root) if child.tag in ("model", "include")]
    if not found:
        held = ", ".join("<%s>" % child.tag for child in document.children(document.root)) or "nothing"
        raise document.error(document.root, "it holds %s; expected one <model>" % held)
    for further in found[1:]:
        document.note(further, "<%s> behind the first, which alone counts" % further.tag)
    if found[0].tag == "model":
        model = reader.model(document, found[0])
    else:
        model = reader.included(document, found[0], 0)
        if not isinstance(model, SdfModel):
            raise document.error(found[0], "it includes lights only; expected a model")
    model.warning = document.notes.warning()
    return model


@dataclass
class Included:
    """The content of an included file besides or instead of a model."""

    lights: list[Light] = field(default_factory=list)


class ModelReader:
    """Reads <model> and <include> elements."""

    def __init__(self, folders: ModelFolders) -> None:
        self._folders = folders
        self._materials = MaterialScripts(folders)
        self._opened = 0

    def model(self, document: Document, element: etree._Element, depth: int = 0,
              static: bool | None = None) -> SdfModel:
        """Return the SdfModel of a <model>. ``static`` overrides its own element."""
        name = document.name(element)
        parts = self._parts(document, element, "", np.eye(4), depth)
        return self._finish(document, name, parts, document.pose(element), static)

    def included(self, document: Document, element: etree._Element, depth: int) -> SdfModel | Included:
        """Return the SdfModel that an <include> asks for, or Included for a file without a model."""
        inner, model = self._open(document, element, depth)
        if model is None:
            return Included([read_light(inner, light, np.eye(4)) for light in inner.root.iterchildren("light")])
        if model.tag == "actor":
            return actor(inner, model, document.text(element, "name", ""),
                         document.pose(element) if element.find("pose") is not None else None)
        parts = self._parts(inner, model, "", np.eye(4), depth + 1)
        parts.gazebo += _plugins(document, element)
        pose = document.pose(element) if element.find("pose") is not None else inner.pose(model)
        static = document.flag(element, "static") if element.find("static") is not None else None
        name = document.text(element, "name", "") or inner.name(model)
        return self._finish(inner, name, parts, pose, static)

    def _finish(self, document: Document, name: str, parts: ModelParts, pose: np.ndarray,
                static: bool | None) -> SdfModel:
        if static is not None:
            parts.static = static
        robot = build_robot(document, name, parts)
        try:
            check_robot(robot)
            bounds.POSITION.check(pose[:3, 3], "the position of the model")
        except OutOfBounds as error:
            raise SdfError("%s: model '%s': %s" % (document.source, name, error)) from None
        if parts.static:
            said = etree.Element("gazebo")
            etree.SubElement(said, "static").text = "true"
            robot.gazebo.append(said)
        return SdfModel(name, robot, pose, parts.static)

    def _open(self, document: Document, element: etree._Element, depth: int) -> tuple[Document, etree._Element | None]:
        """Return (Document, <model> or None) of the file that an <include> names."""
        uri = document.text(element, "uri")
        if depth >= _DEEPEST_INCLUDE:
            raise document.error(element, "include of %s: more than %d files deep; is it in a circle?" % (uri, depth))
        self._opened += 1
        if self._opened > bounds.INCLUDES:
            raise document.error(element, "more than %d files are included; do they include each other?"
                                 % bounds.INCLUDES)
        path = self._folders.find(uri, document.folder)
        stand_in = self._folders.stand_in(uri) if path is None else None
        if stand_in is not None:
            document.mend(element, "%s does not exist, a shape of its size replaces it" % uri)
            inner = Document(stand_in, "the stand-in of %s" % uri, None, document.notes)
            return inner, inner.root.find("model")
        if path is None:
            looked = ", ".join(map(str, self._folders.folders)) or "no folder"
            raise document.error(
                element, "model %s not found; looked in %s; add its folder to GAZEBO_MODEL_PATH" % (uri, looked)
            )
        try:
            content = read_file(path, bounds.DESCRIPTION_BYTES)
        except OSError as error:
            raise document.error(element, "%s (%s) cannot be read: %s" % (uri, path, error.strerror)) from None
        inner = Document(content, path, Path(path).parent, document.notes)
        models = inner.root.findall("model") or inner.root.findall("actor")
        if not models and not inner.root.findall("light"):
            raise inner.error(inner.root, "it holds no <model>, expected one")
        for further in models[1:]:
            inner.note(further, "<%s> behind the first, which alone counts" % further.tag)
        return inner, models[0] if models else None

    def _parts(self, document: Document, element: etree._Element, prefix: str, origin: np.ndarray,
               depth: int) -> ModelParts:
        """Return the ModelParts of a model: names begin with ``prefix``, frames are moved by ``origin`` (4x4)."""
        if element.get("placement_frame"):
            document.note(element, "placement_frame of model '%s'" % element.get("name"))
        parts = ModelParts()
        frames = Frames(document, element.get("name", "").strip())
        held = self._nested(document, element, parts, frames, depth)
        for link in element.iterchildren("link"):
            frames.add(document.name(link), link)
        for frame in element.iterchildren("frame"):
            frames.add(document.name(frame), frame, frame.get("attached_to", ""))
        frame_of = {joint: frames.add_joint(document.name(joint), joint, _end(document, joint, "child"))
                    for joint in element.iterchildren("joint")}
        nested, parts.links = parts.links, {}
        for link in element.iterchildren("link"):
            name = document.name(link)
            if name in parts.links or name in nested:
                raise document.error(link, "link '%s' appears twice" % name)
            read = read_link(document, link, name, self._materials)
            read.self_collide = document.flag(link, "self_collide", document.flag(element, "self_collide"))
            parts.links[name] = (read, frames.where(name, link))
            parts.gazebo += _sensors_and_lights(document, link, name)
        parts.links.update(nested)  # behind its own, as in Gazebo, whose canonical link is the first
        if not parts.links:
            raise document.error(element, "model '%s' has no <link>" % element.get("name"))
        if held and len(held) == len(parts.links):
            _say_static(parts, True)
        elif held and not parts.static:
            document.note(element, "static of the models in '%s', beside links that are not" % element.get("name"))
        names = {joint.name for joint in parts.joints}
        for joint in element.iterchildren("joint"):
            if joint.get("type") == "gearbox":
                parts.gearboxes.append(_gearbox(document, joint, frames, frame_of[joint]))
                continue
            read = _joint(document, joint, frames, frame_of[joint])
            read[0].parent, read[-1].child = frames.plain(read[0].parent), frames.plain(read[-1].child)
            if read[0].name in names:
                raise document.error(joint, "joint '%s' appears twice" % read[0].name)
            names.update(part.name for part in read)
            parts.joints += read
            parts.links.update(crosses(read, parts.links))
            parts.gazebo += _sensors_and_lights(document, joint, read[0].name)
        self._hold_kinematic(document, element, parts)
        parts.gazebo += _plugins(document, element)
        parts.gazebo += [copy.deepcopy(child) for child in element.iterchildren("gazebo")]
        return _moved(parts, prefix, origin)

    def _hold_kinematic(self, document: Document, element: etree._Element, parts: ModelParts) -> None:
        """Make a model of kinematic links fixed: only services move it, no force does."""
        links = list(element.iterchildren("link"))
        kinematic = [link for link in links if document.flag(link, "kinematic")]
        if kinematic and len(kinematic) == len(links):
            parts.static = True
            return
        for link in kinematic:
            document.note(link.find("kinematic"), "kinematic of link '%s', beside links that are not"
                          % document.name(link))

    def _nested(self, document: Document, element: etree._Element, parts: ModelParts, frames: Frames,
                depth: int) -> list[str]:
        """Add the parts of models inside this one to ``parts`` and their frames to ``frames``.

        An included model becomes a part of this one: its <static> is one of this model, of which the first counts.
        Returns the names of the links of other static models in it.
        """
        held = []
        names = {child.get("name") for child in element.iterchildren("model")}
        for child in element.iterchildren("static", "model", "include"):
            if child.tag == "static":
                _say_static(parts, document.flag(element, "static"))
                continue
            if child.tag == "model":
                inner, model, name = document, child, document.name(child)
                frames.add(name, child)
            else:
                inner, model = self._open(document, child, depth)
                if model is None or model.tag == "actor":
                    document.note(child, "%s inside of a model" % ("lights" if model is None else "an actor"))
                    continue
                name = document.text(child, "name", "") or unused(inner.name(model), names)
                names.add(name)
                frames.add(name, child, pose=None if child.find("pose") is not None else inner.pose(model))
            origin = frames.where(name, child)
            below = self._parts(inner, model, name + "::", origin, depth + 1)
            if child.tag == "include":
                said = document.flag(child, "static", below.static)
                if below.static_is_said or child.find("static") is not None:
                    _say_static(parts, said)
            elif below.static:
                held += below.links
            for link_name, (_, frame) in below.links.items():
                frames.add(link_name, child, pose=frame)
            parts.links.update(below.links)
            if len(parts.links) > bounds.LINKS:
                raise document.error(child, "more than %d links in one model" % bounds.LINKS)
            parts.joints += below.joints
            parts.gearboxes += below.gearboxes
            parts.gazebo += below.gazebo
        return held


def actor(document: Document, element: etree._Element, name: str = "", pose: np.ndarray | None = None) -> SdfModel:
    """Return the SdfModel of an <actor>; ``name`` and ``pose`` (4x4) in place of its own."""
    name = name or document.name(element)
    robot = actor_robot(document, element, name)
    return SdfModel(name, robot, document.pose(element) if pose is None else pose, True)


def _say_static(parts: ModelParts, static: bool) -> None:
    if not parts.static_is_said:
        parts.static, parts.static_is_said = static, True


def unused(name: str, names: Collection[str]) -> str:
    """Return ``name``, or the first of name_0, name_1, ... that is not in ``names`` if it is."""
    found, number = name, 0
    while found in names:
        found, number = "%s_%d" % (name, number), number + 1
    return found


def _moved(parts: ModelParts, prefix: str, origin: np.ndarray) -> ModelParts:
    """Return ``parts`` with names and frames of the enclosing scope."""
    if not prefix:
        return parts
    links = {}
    for name, (link, frame) in parts.links.items():
        link.name = prefix + name
        links[link.name] = (link, origin @ frame)
    for joint in parts.joints:
        joint.name, joint.frame = prefix + joint.name, origin @ joint.frame
        joint.parent, joint.child = (end if end == "world" else prefix + end for end in (joint.parent, joint.child))
        if joint.follows is not None:
            joint.follows = Gear(prefix + joint.follows.joint, prefix + joint.follows.other, joint.follows.ratio)
    for said in parts.gazebo:
        if said.get("reference"):
            said.set("reference", prefix + said.get("reference"))
        else:
            said.set("scope", prefix + said.get("scope", ""))
    gearboxes = [gearbox.moved(prefix, origin[:3, :3]) for gearbox in parts.gearboxes]
    return ModelParts(links, parts.joints, parts.gazebo, gearboxes, parts.static, parts.static_is_said)


def _sensors_and_lights(document: Document, link: etree._Element, name: str) -> list[etree._Element]:
    """Return the <sensor> and <light> elements of a link or joint, and its <visual>s with plugins, as a <gazebo>
    element that refers to it, the way a URDF has them."""
    for light in link.iterchildren("light"):
        read_light(document, light, np.eye(4))  # complains here, where file and line are known
    found = link.findall("sensor") + link.findall("light")
    for visual in link.iterchildren("visual"):
        if visual.find("plugin") is not None:
            found.append(etree.Element("visual", name=visual.get("name", "")))
            found[-1].extend([copy.deepcopy(plugin) for plugin in visual.findall("plugin")])
    if not found:
        return []
    holder = etree.Element("gazebo", reference=name)
    holder.extend([copy.deepcopy(sensor) for sensor in found])
    return [holder]


def _plugins(document: Document, element: etree._Element) -> list[etree._Element]:
    """Return the <plugin> elements as a <gazebo> element, the way a URDF has them."""
    found = element.findall("plugin")
    if not found:
        return []
    holder = etree.Element("gazebo")
    holder.extend([copy.deepcopy(plugin) for plugin in found])
    return [holder]


def _bounded(document: Document, element: etree._Element, tag: str, value: float, bound: bounds.Bound) -> float:
    """Return ``value`` within ``bound``, which is noted where it makes a difference."""
    used = min(max(value, bound.low), bound.high)
    if used != value:
        document.mend(element, "<%s> of %g, for which %g is used" % (tag, value, used))
    return used


def _end(document: Document, joint: etree._Element, role: str) -> str:
    element = joint.find(role)
    if element is not None and element.get("link"):
        return element.get("link").strip()
    return document.text(joint, role)


def _joint(document: Document, element: etree._Element, frames: Frames, own_frame: str) -> list[SdfJoint]:
    """Return the SdfJoint of a <joint>, in a list: one for each of its axes, with a link named after the joint between
    two of them."""
    name, kind = document.name(element), element.get("type", "")
    frame = frames.where(own_frame, element)
    if kind in _MOVABLE:
        rows = [_turn(document, element, "axis", kind, frame, frames)]
    elif kind in _TWO_AXES:
        rows = [_turn(document, element, tag, "revolute", frame, frames) for tag in ("axis", "axis2")]
    elif kind == "screw":
        turn = _turn(document, element, "axis", "revolute", frame, frames)
        rows = [turn, ("prismatic", Limit(), turn[2], Dynamics())]
    elif kind == "ball":
        rows = [("continuous", Limit(), axis, Dynamics()) for axis in np.eye(3)]
    else:
        if not kind:
            raise document.error(element, "joint '%s' has no type; known: %s, fixed, ball, screw, gearbox, %s"
                                 % (name, ", ".join(_MOVABLE), ", ".join(_TWO_AXES)))
        if kind != "fixed":
            document.note(element, "joint '%s' of type %s, which is held fixed" % (name, kind))
        rows = [("fixed", Limit(), np.array([0.0, 0.0, 1.0]), Dynamics())]
    implicit = any(document.flag(element, "physics/ode/" + tag) for tag in ("implicit_spring_damper", "cfm_damping"))
    ends = [_end(document, element, "parent"), *("%s_cross%d" % (name, number) for number in range(1, len(rows))),
            _end(document, element, "child")]
    found = [SdfJoint(name if number == 0 else "%s_axis%d" % (name, number + 1), turning, ends[number],
                      ends[number + 1], frame, axis, limit, dynamics, implicit, element)
             for number, (turning, limit, axis, dynamics) in enumerate(rows)]
    if kind == "screw":
        found[1].follows = Gear(found[0].name, found[1].name, -1.0 / _pitch(document, element))
    return found


def _pitch(document: Document, screw: etree._Element) -> float:
    """The <thread_pitch> of a screw [rad/m]: it goes on by -1 / pitch for each radian (ODE's sign)."""
    pitch = document.number(screw, "thread_pitch", 1.0)
    if not 1.0 / bounds.JOINT_POSITION.high <= abs(pitch) <= bounds.JOINT_POSITION.high:
        document.mend(screw, "<thread_pitch> of %g, for which 1 is used" % pitch)
        return 1.0
    return pitch


def _gearbox(document: Document, element: etree._Element, frames: Frames, own_frame: str) -> Gearbox:
    """Return the Gearbox of a <joint>."""
    name, frame = document.name(element), frames.where(own_frame, element)
    first, second = (frame[:3, :3] @ _turn(document, element, tag, "revolute", frame, frames)[2]
                     for tag in ("axis", "axis2"))
    parent, child, reference = (frames.plain(_end(document, element, role))
                                for role in ("parent", "child", "gearbox_reference_body"))
    return Gearbox(name, parent, child, reference, document.number(element, "gearbox_ratio", 1.0), (first, second),
                   element)


def _turn(document: Document, joint: etree._Element, tag: str, kind: str, frame: np.ndarray,
          frames: Frames) -> tuple[str, Limit, np.ndarray, Dynamics]:
    """Return (type, Limit, axis (3,), Dynamics) of the <axis> or <axis2> ``tag`` of a joint."""
    name, given = document.name(joint), joint.find(tag)
    if given is None:
        document.mend(joint, "%s joint '%s' without <%s>, which is 0 0 1" % (kind, name, tag))
        given = etree.Element(tag)
    return (*_limit(document, given, name, kind), _axis(document, given, name, frame, frames),
            _dynamics(document, given))


def _dynamics(document: Document, axis: etree._Element) -> Dynamics:
    element = axis.find("dynamics")
    if element is None:
        return Dynamics()
    # Gazebo takes a negative damping or stiffness for one that it may reduce.
    return Dynamics(*(_bounded(document, element, tag, take(document.number(element, tag, 0.0, True)), bound)
                      for tag, take, bound in (("damping", abs, bounds.DAMPING), ("friction", float, bounds.FRICTION),
                                               ("spring_stiffness", abs, bounds.DAMPING),
                                               ("spring_reference", float, bounds.POSITION))))


def _axis(document: Document, given: etree._Element, name: str, frame: np.ndarray, frames: Frames) -> np.ndarray:
    """Return the unit axis in the joint's frame, from whichever frame it is written in."""
    element = given.find("xyz")
    axis = np.array(document.vector(given, "xyz", (0.0, 0.0, 1.0)))
    length = np.linalg.norm(axis)
    if length < 1e-9:
        document.mend(element, "axis of joint '%s', which is zero: 1 0 0, as for ODE" % name)
        axis, length = np.array([1.0, 0.0, 0.0]), 1.0
    axis = axis / length
    expressed_in = None if element is None else element.get("expressed_in")
    if expressed_in:
        in_model = frames.where(expressed_in, element)[:3, :3] @ axis
    elif document.version < (1, 5) or document.flag(given, "use_parent_model_frame"):
        in_model = axis
    else:
        return axis
    return frame[:3, :3].T @ in_model


def _limit(document: Document, given: etree._Element, name: str, kind: str) -> tuple[str, Limit]:
    """Return (type, Limit): a revolute joint without limits is a continuous one."""
    element = given.find("limit")
    if element is None:
        return ("continuous" if kind == "revolute" else kind), Limit()
    lower = document.number(element, "lower", -math.inf, may_be_infinite=True)
    upper = document.number(element, "upper", math.inf, may_be_infinite=True)
    if lower > upper:
        document.mend(element, "joint '%s' with lower limit %g above its upper limit %g: no limits, as for ODE"
                      % (name, lower, upper))
        lower, upper = -math.inf, math.inf
    # In SDF, a negative limit means unlimited.
    values = (document.number(element, tag, -1.0, may_be_infinite=True) for tag in ("effort", "velocity"))
    effort, velocity = (value if 0.0 <= value <= bounds.NO_LIMIT else None for value in values)
    if lower <= -bounds.NO_LIMIT and upper >= bounds.NO_LIMIT or kind == "continuous":
        return ("continuous" if kind == "revolute" else kind), Limit(velocity=velocity, effort=effort)
    lower, upper = max(lower, -bounds.NO_LIMIT), min(upper, bounds.NO_LIMIT)
    return kind, Limit(lower, upper, velocity, effort)
