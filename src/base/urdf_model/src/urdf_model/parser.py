# SPDX-License-Identifier: BSD-3-Clause
"""Read URDF text into dataclasses; complain in one line with source, line number, what was found, what is right."""
from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from . import bounds
from .errors import UrdfError
from .gazebo_blocks import apply_blocks
from .model import (
    MOVABLE_TYPES,
    Box,
    Cylinder,
    Finish,
    Inertial,
    Joint,
    Limit,
    Link,
    Mesh,
    Mimic,
    Robot,
    Shape,
    Sphere,
    Transmission,
    TransmissionJoint,
    is_true,
)
from .transforms import pose_matrix
from .xml_text import XmlRefused, parse_xml

if TYPE_CHECKING:
    from lxml import etree

JOINT_TYPES = MOVABLE_TYPES + ("fixed", "floating", "planar")
#: Of a material: rgba, and what it has besides.
Look = tuple[tuple[float, float, float, float] | None, Finish | None]
Named = TypeVar("Named", Link, Joint)
Default = TypeVar("Default", float, None)
_MOMENTS = (((0, 0), "ixx"), ((0, 1), "ixy"), ((0, 2), "ixz"), ((1, 1), "iyy"), ((1, 2), "iyz"), ((2, 2), "izz"))


def parse_urdf(xml: str | bytes, source: str = "robot_description") -> Robot:
    """Return the Robot that ``xml`` (str or bytes) describes. ``source`` names it in messages.

    What urdfdom, the reader of Gazebo and rviz, accepts is accepted, with its repairs: they are listed in
    ``Robot.warnings``, each with its line. Raises UrdfError for all others: malformed XML, another root element,
    duplicate names, unknown links, a tree with no or several roots, joints with numbers that are none, numbers out of
    bounds (``bounds``), more than a description may hold.
    """
    robot = _Reader(xml, source).robot()
    try:
        bounds.check_robot(robot)
    except bounds.OutOfBounds as error:
        raise UrdfError("%s: %s" % (source, error)) from None
    return robot


class _Reader:
    def __init__(self, xml: str | bytes, source: str) -> None:
        self.source = source
        self.warnings: list[str] = []
        try:
            root = parse_xml(xml)
        except XmlRefused as error:
            raise UrdfError("%s %s" % (source, error)) from None
        if root is None or root.tag != "robot":
            found = "nothing" if root is None else "<%s>" % root.tag
            raise UrdfError("%s is not a URDF: its root element is %s, expected <robot>" % (source, found))
        self.root = root

    def error(self, element: etree._Element, text: str) -> UrdfError:
        return UrdfError("%s, line %s: %s" % (self.source, element.sourceline, text))

    def warn(self, element: etree._Element, text: str) -> None:
        self.warn_at(element.sourceline, text)

    def warn_at(self, line: int, text: str) -> None:
        self.warnings.append("%s, line %s: %s" % (self.source, line, text))

    # -- whole --------------------------------------------------------------------------------------------------

    def robot(self) -> Robot:
        name = self.root.get("name") or "robot"
        looks = self.looks()
        links, joints = {}, {}
        left_over = [e for e in self.root.iterchildren("{*}*") if "xacro" in "%s %s" % (e.prefix, e.tag)]
        if left_over:
            self.warn(left_over[0], "%d xacro element%s did nothing, from here on; run the file through xacro first"
                      % (len(left_over), "s"[:len(left_over) > 1]))
        for element in self.root.iterchildren("link"):
            link = self.link(element, looks)
            self.add_unique(links, link, element, "link")
        for element in self.root.iterchildren("joint"):
            joint = self.joint(element)
            self.add_unique(joints, joint, element, "joint")
        if not links:
            raise self.error(self.root, "robot '%s' has no <link>%s" % (
                name, "; it still holds xacro elements: run it through xacro first" if left_over else ""))
        root = self.tree_root(name, links, joints)
        for joint in joints.values():
            if joint.mimic is not None and joint.mimic.joint not in joints:
                self.warn_at(joint.line, "joint '%s' mimics '%s', which does not exist, and so mimics none; joints: %s"
                             % (joint.name, joint.mimic.joint, ", ".join(joints)))
                joint.mimic = None
        transmissions = [self.transmission(e) for e in self.root.iterchildren("transmission")]
        robot = Robot(name, links, joints, root, transmissions, list(self.root.iterchildren("gazebo")), self.warnings)
        apply_blocks(robot, self.warn)
        return robot

    def add_unique(self, table: dict[str, Named], item: Named, element: etree._Element, kind: str) -> None:
        if item.name in table:
            raise self.error(
                element, "%s '%s' appears twice (first in line %s)" % (kind, item.name, table[item.name].line)
            )
        table[item.name] = item

    def tree_root(self, name: str, links: dict[str, Link], joints: dict[str, Joint]) -> str:
        """Return the root link's name. Joints and links that are no part of its tree are removed, with a warning."""
        parent_of = {}
        for joint in joints.values():
            for role in ("parent", "child"):
                if getattr(joint, role) not in links:
                    raise UrdfError(
                        "%s, line %s: joint '%s' names %s link '%s', which does not exist"
                        % (self.source, joint.line, joint.name, role, getattr(joint, role))
                    )
        # Of several joints with the same child, the last one in the order of their names counts.
        for joint in sorted(joints.values(), key=lambda one: one.name):
            if joint.child in parent_of:
                other = parent_of[joint.child]
                self.warn_at(other.line, "link '%s' is the child of two joints; '%s' is left out, '%s' counts"
                             % (joint.child, other.name, joint.name))
                del joints[other.name]
            parent_of[joint.child] = joint
        roots = [link for link in links if link not in parent_of]
        if len(roots) != 1:
            found = (
                "no root link (its joints form a loop)"
                if not roots
                else "%d root links: %s" % (len(roots), ", ".join(roots))
            )
            raise UrdfError("%s: robot '%s' has %s; expected exactly one" % (self.source, name, found))
        reached, stack = set(), [roots[0]]
        below = {}
        for joint in joints.values():
            below.setdefault(joint.parent, []).append(joint.child)
        while stack:
            link = stack.pop()
            reached.add(link)
            stack.extend(below.get(link, ()))
        for link in [link for link in links if link not in reached]:
            joint = parent_of[link]
            self.warn_at(joint.line, "joint '%s' is part of a loop that root '%s' does not reach; it and link '%s' are "
                         "left out" % (joint.name, roots[0], link))
            del links[link], joints[joint.name]
        return roots[0]

    # -- elements -----------------------------------------------------------------------------------------------

    def link(self, element: etree._Element, looks: dict[str, Look]) -> Link:
        """Return the Link. As urdfdom does, what follows the first part that cannot be read is left out: parts are
        read in the order inertial, visuals, collisions."""
        link = Link(self.name(element), line=element.sourceline)
        inertials = [*element.iterchildren("inertial")]
        parts = [*inertials[:1], *element.iterchildren("visual"), *element.iterchildren("collision")]
        inertial = Inertial(0.0, np.zeros(3), np.zeros((3, 3)))
        for further in inertials[1:]:
            self.warn(further, "link '%s' has an <inertial> already; this one is ignored" % link.name)
        for count, part in enumerate(parts):
            try:
                if part.tag == "inertial":
                    link.inertial = inertial
                    self.inertial(part, inertial, link.name)
                    continue
                shape = self.shape(part, looks, link.name)
            except UrdfError as error:
                left = [one.tag for one in parts[count:]]
                said = ["%d <%s>" % (left.count(tag), tag) for tag in ("visual", "collision") if tag in left]
                if part.tag == "inertial":
                    said.insert(0, "its mass is %g kg" % inertial.mass)
                self.warnings.append("%s. Link '%s' is read as by urdfdom, up to there: %s%s"
                                     % (error, link.name, ", ".join(said), " left out" if len(left) > 1 or
                                        part.tag != "inertial" else ""))
                break
            if shape is not None:
                (link.visuals if part.tag == "visual" else link.collisions).append(shape)
        return link

    def inertial(self, element: etree._Element, inertial: Inertial, link: str) -> None:
        """Read the <inertial> of ``link`` into ``inertial``."""
        origin = self.origin(element)
        mass = self.child(element, "mass")
        value = self.required_number(mass, "value")
        if value < 0.0:
            self.warn(mass, "mass of link '%s' is %g kg; 0 is assumed" % (link, value))
        inertial.mass = max(value, 0.0)
        inertial.centre = origin[:3, 3].copy()
        matrix = np.zeros((3, 3))
        inertia = element.find("inertia")
        missing = [key for _, key in _MOMENTS if inertia is None or inertia.get(key) is None]
        if missing:
            self.warn(element, "inertia of link '%s' has no %s; 0 is assumed (for urdfdom, such a link has no shapes)"
                      % (link, ", ".join(missing)))
        if inertia is None:
            return
        for (i, j), key in _MOMENTS:
            matrix[i, j] = matrix[j, i] = self.number(inertia, key, default=0.0)
        smallest = float(np.linalg.eigvalsh(matrix)[0])
        if smallest < -1e-9 * max(1e-9, float(np.abs(matrix).max())):
            self.warn(
                inertia,
                "inertia of link '%s' has the negative principal moment %g kg m^2; no body has that"
                % (link, smallest),
            )
        rotation = origin[:3, :3]
        inertial.inertia = rotation @ matrix @ rotation.T

    def shape(self, element: etree._Element, looks: dict[str, Look], link: str) -> Shape | None:
        """Return the Shape of a <visual> or <collision>; None for a mesh whose name is empty."""
        origin = self.origin(element)
        geometry = self.child(element, "geometry")
        shapes = [e for e in geometry if isinstance(e.tag, str)]
        if not shapes:
            raise self.error(geometry, "<geometry> of link '%s' holds no shape" % link)
        read = self.geometry(shapes[0], link)
        for further in shapes[1:]:
            self.warn(further, "<%s> is ignored: <geometry> of link '%s' holds a <%s> already"
                      % (further.tag, link, shapes[0].tag))
        material = element.find("material")
        if material is not None and material.get("name") is None and element.tag == "visual":
            raise self.error(material, "<material> of link '%s' has no name" % link)
        colour, finish = (None, None) if material is None else self.look(material, looks)
        return None if read is None else Shape(read, origin, element.get("name", ""), colour, link, finish)

    def geometry(self, element: etree._Element, link: str) -> Box | Cylinder | Sphere | Mesh | None:
        if element.tag == "box":
            x, y, z = self.positive(element, "size", 3, link)
            return Box((x, y, z))
        if element.tag == "cylinder":
            return Cylinder(self.positive(element, "radius", 1, link)[0], self.positive(element, "length", 1, link)[0])
        if element.tag == "sphere":
            return Sphere(self.positive(element, "radius", 1, link)[0])
        if element.tag == "mesh":
            filename = element.get("filename")
            if filename is None:
                raise self.error(element, "<mesh> of link '%s' has no filename" % link)
            x, y, z = self.vector(element, "scale", 3, default=(1.0, 1.0, 1.0))
            if not filename:
                self.warn(element, "<mesh> of link '%s' has an empty filename and is left out" % link)
                return None
            return Mesh(filename, (x, y, z), element.get("submesh", ""), is_true(element.get("centred")))
        raise self.error(
            element, "link '%s' has a <%s>; known shapes are box, cylinder, sphere and mesh" % (link, element.tag)
        )

    def joint(self, element: etree._Element) -> Joint:
        name = self.name(element)
        kind = element.get("type")
        if kind not in JOINT_TYPES:
            raise self.error(element, "joint '%s' has type '%s'; known: %s" % (name, kind, ", ".join(JOINT_TYPES)))
        if kind in ("floating", "planar"):
            self.warn(element, "joint '%s' is %s: Gazebo has no such joint, its child moves freely" % (name, kind))
        axis = self.vector(element.find("axis"), "xyz", 3, default=(1.0, 0.0, 0.0))
        length = math.sqrt(sum(a * a for a in axis))
        if length < 1e-9:
            if kind in MOVABLE_TYPES:
                self.warn(element, "axis of joint '%s' is zero; 1 0 0 is assumed, as ODE does" % name)
            axis, length = (1.0, 0.0, 0.0), 1.0
        if not length <= bounds.NO_LIMIT:
            raise self.error(
                element, "axis of joint '%s' is %s; expected a direction such as 0 0 1" % (name, _words(axis))
            )
        dynamics, mimic = element.find("dynamics"), element.find("mimic")
        return Joint(
            name,
            kind,
            self.link_reference(element, "parent", name),
            self.link_reference(element, "child", name),
            self.origin(element),
            np.array(axis) / length,
            self.limit(element, name, kind),
            None if mimic is None else self.mimic(mimic, name),
            *((0.0, 0.0) if dynamics is None else self.dynamics(dynamics, name)),
            element.sourceline,
        )

    def dynamics(self, element: etree._Element, name: str) -> tuple[float, float]:
        """Return damping and friction. Gazebo takes a negative damping for one that it may reduce to keep the joint
        stable, and no negative friction."""
        damping, friction = (self.number(element, key, default=0.0) for key in ("damping", "friction"))
        used = min(abs(damping), bounds.DAMPING.high), min(max(friction, 0.0), bounds.FRICTION.high)
        for key, number, instead in zip(("damping", "friction"), (damping, friction), used, strict=True):
            if number != instead:
                self.warn(element, "%s of joint '%s' is %g; %g is used" % (key, name, number, instead))
        return used

    def limit(self, joint: etree._Element, name: str, kind: str) -> Limit:
        element = joint.find("limit")
        if element is None:
            if kind in ("revolute", "prismatic"):
                raise self.error(
                    joint,
                    "%s joint '%s' has no <limit lower= upper= effort= velocity=>; use type continuous for an "
                    "unlimited one" % (kind, name),
                )
            return Limit()
        limit = Limit(velocity=self.number(element, "velocity", None), effort=self.number(element, "effort", None))
        # Some tools write the largest float for "none".
        limit.velocity, limit.effort = (
            None if value is not None and value > bounds.NO_LIMIT else value
            for value in (limit.velocity, limit.effort)
        )
        for what in ("velocity", "effort"):
            value = getattr(limit, what)
            if value is not None and value < 0.0:
                self.warn(element, "%s limit of joint '%s' is %g, which means none" % (what, name, value))
                setattr(limit, what, None)
        if kind in ("revolute", "prismatic"):
            limit.lower, limit.upper = (
                min(max(self.number(element, key, default=0.0), -bounds.NO_LIMIT), bounds.NO_LIMIT)
                for key in ("lower", "upper")
            )
            if limit.lower > limit.upper:
                self.warn(element, "joint '%s' has lower limit %g above its upper limit %g; it has no limits, as in ODE"
                          % (name, limit.lower, limit.upper))
                limit.lower, limit.upper = -bounds.NO_LIMIT, bounds.NO_LIMIT
        return limit

    def mimic(self, element: etree._Element, name: str) -> Mimic:
        other = element.get("joint")
        if not other:
            raise self.error(element, "<mimic> of joint '%s' has no joint attribute" % name)
        multiplier = self.number(element, "multiplier", default=1.0)
        return Mimic(other, multiplier, self.number(element, "offset", default=0.0))

    def transmission(self, element: etree._Element) -> Transmission:
        name = element.get("name", "")
        kind = (element.findtext("type") or element.get("type") or "").strip()
        found = []
        for joint in element.iterchildren("joint"):
            interfaces = tuple((e.text or "").strip() for e in joint.iterchildren("hardwareInterface"))
            found.append(TransmissionJoint(joint.get("name", ""), interfaces))
        reductions, actuators = [], []
        for actuator in element.iterchildren("actuator"):
            actuators.append(actuator.get("name", ""))
            reductions.append(_reduction(actuator.findtext("mechanicalReduction")))
        return Transmission(name, kind, tuple(found), tuple(reductions), tuple(actuators))

    # -- pieces -------------------------------------------------------------------------------------------------

    def looks(self) -> dict[str, Look]:
        """Return {name: (rgba or None, Finish or None)} of the materials beside the links."""
        table = {}
        for element in self.root.iterchildren("material"):
            look = self.own_look(element)
            if element.get("name") and look != (None, None):
                table[element.get("name")] = look
            else:
                self.warn(element, "material '%s' lacks a name, or a colour and a texture" % element.get("name", ""))
        return table

    def look(self, element: etree._Element, looks: dict[str, Look]) -> Look:
        look, name = self.own_look(element), element.get("name", "")
        if look != (None, None):
            # A material may be defined inside the first visual that uses it and be referred to by name afterwards.
            looks.setdefault(name, look)
        elif name and name not in looks and element.find("color") is None:
            self.warn(element, "material '%s' is defined nowhere" % name)
            looks[name] = look
        return look if look != (None, None) else looks.get(name, look)

    def colour(self, element: etree._Element | None, material: str) -> tuple[float, float, float, float] | None:
        """Return the rgba of a <color>, None where it cannot be read."""
        if element is None:
            return None
        try:
            rgba = self.required_vector(element, "rgba", None)
        except UrdfError as error:
            self.warnings.append("%s; the colour of material '%s' is left out" % (error, material))
            return None
        if any(not 0.0 <= value <= 1.0 for value in rgba):
            self.warn(element, "the colour of material '%s', %s, is left out; expected numbers from 0 to 1"
                      % (material, _words(rgba)))
            return None
        if len(rgba) != 4:
            self.warn(element, "the colour of material '%s' has %d numbers, expected 4; urdfdom takes it for black"
                      % (material, len(rgba)))
            return (0.0, 0.0, 0.0, 1.0)
        red, green, blue, opacity = rgba
        return red, green, blue, opacity

    def own_look(self, element: etree._Element) -> Look:
        rgba = self.colour(element.find("color"), element.get("name", ""))
        try:
            return rgba, self.finish(element)
        except UrdfError as error:
            self.warnings.append("%s; material '%s' is read without it" % (error, element.get("name", "")))
            return rgba, None

    def finish(self, element: etree._Element) -> Finish | None:
        """Return the Finish of a <material>, None where it has none."""
        texture, emission, gloss = (element.find(tag) for tag in ("texture", "emission", "gloss"))
        if texture is not None and texture.get("filename") is None:
            self.warn(texture, "<texture> of material '%s' has no filename" % element.get("name", ""))
        if texture is None and emission is None and gloss is None:
            return None
        none = Finish()
        red, green, blue = self.vector(emission, "rgb", 3, default=none.emission)
        strength = None if gloss is None else self.required_number(gloss, "value")
        right, down = self.vector(texture, "repeats", 2, default=none.repeats)
        return Finish(
            (red, green, blue),
            strength,
            "" if texture is None else texture.get("filename", ""),
            (right, down),
            *(texture is not None and is_true(texture.get(key)) for key in ("cut_out", "two_sided")),
        )

    def origin(self, element: etree._Element) -> np.ndarray:
        origin = element.find("origin")
        if origin is None:
            return np.eye(4)
        zero = (0.0, 0.0, 0.0)
        return pose_matrix(self.vector(origin, "xyz", 3, default=zero), self.vector(origin, "rpy", 3, default=zero))

    def name(self, element: etree._Element) -> str:
        name = element.get("name")
        if not name:
            raise self.error(element, "<%s> has no name" % element.tag)
        return name

    def child(self, element: etree._Element, tag: str) -> etree._Element:
        child = element.find(tag)
        if child is None:
            raise self.error(element, "<%s> has no <%s>" % (element.tag, tag))
        return child

    def link_reference(self, element: etree._Element, role: str, name: str) -> str:
        link = self.child(element, role).get("link")
        if not link:
            raise self.error(element, "joint '%s' has a <%s> without a link attribute" % (name, role))
        return link

    def positive(self, element: etree._Element, key: str, count: int, link: str) -> list[float]:
        values = self.required_vector(element, key, count)
        if all(value > 0.0 for value in values):
            return values
        # A picture of a negative size looks like that of a positive one.
        used = [max(abs(value), bounds.LENGTH.low) for value in values]
        self.warn(element, "%s of the %s of link '%s' is %s, expected positive numbers; %s is used"
                  % (key, element.tag, link, _words(values), _words(used)))
        return used

    def vector(self, element: etree._Element | None, key: str, count: int | None,
               default: Sequence[float]) -> list[float]:
        """Return the numbers of an attribute, ``default`` where the element or the attribute is missing."""
        if element is None or element.get(key) is None:
            return list(default)
        return self.required_vector(element, key, count)

    def required_vector(self, element: etree._Element, key: str, count: int | None) -> list[float]:
        text = self.required(element, key)
        words = text.split()
        if count is not None and len(words) != count:
            raise self.error(element, "%s='%s' holds %d numbers, expected %d" % (key, text, len(words), count))
        return [self.parse_float(word, element, key) for word in words]

    def number(self, element: etree._Element, key: str, default: Default) -> float | Default:
        """Return the number of an attribute, ``default`` where that is missing."""
        text = element.get(key)
        return default if text is None else self.parse_float(text, element, key)

    def required_number(self, element: etree._Element, key: str) -> float:
        return self.parse_float(self.required(element, key), element, key)

    def required(self, element: etree._Element, key: str) -> str:
        text = element.get(key)
        if text is None:
            raise self.error(element, "<%s> has no %s" % (element.tag, key))
        return text

    def parse_float(self, text: str, element: etree._Element, key: str) -> float:
        try:
            value = float(text.replace("_", "?"))  # 1_000 is a number for Python alone
        except ValueError:
            raise self.error(element, "%s='%s' is not a number" % (key, text)) from None
        if not math.isfinite(value):
            raise self.error(element, "%s='%s' is not finite" % (key, text))
        return value


def _words(values):
    return " ".join("%g" % value for value in values)


def _reduction(text):
    # A wrong transmission does not affect the bodies: controller_manager, which uses it, reports the error.
    try:
        number = float(text)
    except (TypeError, ValueError):
        return 1.0
    return number if math.isfinite(number) else 1.0
