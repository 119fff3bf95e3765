# SPDX-License-Identifier: BSD-3-Clause
"""Read URDF text into dataclasses; complain in one line with source, line number, what was found, what is right."""

import math

import numpy as np

from . import bounds
from .errors import UrdfError
from .materials import GLOWS, MATERIALS
from .model import (
    MAY_BE_INFINITE,
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
    Surface,
    Transmission,
    TransmissionJoint,
)
from .transforms import pose_matrix
from .xml_text import XmlRefused, parse_xml

JOINT_TYPES = MOVABLE_TYPES + ("fixed", "floating", "planar")


def parse_urdf(xml, source="robot_description"):
    """Return the Robot that ``xml`` (str or bytes) describes. ``source`` names it in messages.

    Things that can be repaired (an impossible inertia, a joint type that nothing drives) are listed in
    ``Robot.warnings``. Raises UrdfError for all others: malformed XML, another root element, duplicate or unknown
    names, a tree with no or several roots, numbers that are not finite or out of bounds (``bounds``), more than a
    description may hold.
    """
    robot = _Reader(xml, source).robot()
    try:
        bounds.check_robot(robot)
    except bounds.OutOfBounds as error:
        raise UrdfError("%s: %s" % (source, error)) from None
    return robot


class _Reader:
    def __init__(self, xml, source):
        self.source = source
        self.warnings = []
        try:
            self.root = parse_xml(xml)
        except XmlRefused as error:
            raise UrdfError("%s %s" % (source, error)) from None
        if self.root is None or self.root.tag != "robot":
            found = "nothing" if self.root is None else "<%s>" % self.root.tag
            raise UrdfError("%s is not a URDF: its root element is %s, expected <robot>" % (source, found))
        if any(isinstance(e.tag, str) and "xacro" in e.tag for e in self.root.iterchildren()):
            raise self.error(self.root, "it still holds xacro elements; run it through xacro first")

    def error(self, element, text):
        return UrdfError("%s, line %s: %s" % (self.source, element.sourceline, text))

    def warn(self, element, text):
        self.warnings.append("%s, line %s: %s" % (self.source, element.sourceline, text))

    # -- whole --------------------------------------------------------------------------------------------------

    def robot(self):
        name = self.root.get("name") or "robot"
        looks = self.looks()
        links, joints = {}, {}
        for element in self.root.iterchildren("link"):
            link = self.link(element, looks)
            self.add_unique(links, link, element, "link")
        for element in self.root.iterchildren("joint"):
            joint = self.joint(element)
            self.add_unique(joints, joint, element, "joint")
        if not links:
            raise self.error(self.root, "robot '%s' has no <link>" % name)
        root = self.tree_root(name, links, joints)
        for joint in joints.values():
            if joint.mimic is not None and joint.mimic.joint not in joints:
                raise UrdfError(
                    "%s, line %s: joint '%s' mimics '%s', which does not exist; joints: %s"
                    % (self.source, joint.line, joint.name, joint.mimic.joint, ", ".join(joints))
                )
        transmissions = [self.transmission(e) for e in self.root.iterchildren("transmission")]
        for element in self.root.iterchildren("gazebo"):
            if element.get("reference") in links:
                self.gazebo_reference(element, links[element.get("reference")])
            elif element.get("reference") in joints:
                joints[element.get("reference")].implicit_damping |= any(
                    _is_true(element.findtext(tag)) for tag in ("implicitSpringDamper", "cfmDamping"))
        return Robot(name, links, joints, root, transmissions, list(self.root.iterchildren("gazebo")), self.warnings)

    def add_unique(self, table, item, element, kind):
        if item.name in table:
            raise self.error(
                element, "%s '%s' appears twice (first in line %s)" % (kind, item.name, table[item.name].line)
            )
        table[item.name] = item

    def tree_root(self, name, links, joints):
        parent_of = {}
        for joint in joints.values():
            for role in ("parent", "child"):
                if getattr(joint, role) not in links:
                    raise UrdfError(
                        "%s, line %s: joint '%s' names %s link '%s', which does not exist"
                        % (self.source, joint.line, joint.name, role, getattr(joint, role))
                    )
            if joint.child in parent_of:
                raise UrdfError(
                    "%s, line %s: link '%s' is the child of two joints, '%s' and '%s'; a URDF is a tree"
                    % (self.source, joint.line, joint.child, parent_of[joint.child].name, joint.name)
                )
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
        if len(reached) != len(links):
            raise UrdfError(
                "%s: links not connected to root '%s' (a loop of joints): %s"
                % (self.source, roots[0], ", ".join(sorted(set(links) - reached)))
            )
        return roots[0]

    # -- elements -----------------------------------------------------------------------------------------------

    def link(self, element, looks):
        name = self.name(element)
        inertial = element.find("inertial")
        return Link(
            name,
            None if inertial is None else self.inertial(inertial, name),
            [self.shape(e, looks, name) for e in element.iterchildren("visual")],
            [self.shape(e, looks, name) for e in element.iterchildren("collision")],
            element.sourceline,
        )

    def inertial(self, element, link):
        origin = self.origin(element)
        mass = self.child(element, "mass")
        value = self.number(mass, "value", required=True)
        if value < 0.0:
            raise self.error(mass, "mass of link '%s' is %g kg; expected a positive number" % (link, value))
        matrix = np.zeros((3, 3))
        inertia = element.find("inertia")
        if inertia is None:
            self.warn(element, "link '%s' has no <inertia>; zero is assumed" % link)
        else:
            for (i, j), key in (
                ((0, 0), "ixx"),
                ((0, 1), "ixy"),
                ((0, 2), "ixz"),
                ((1, 1), "iyy"),
                ((1, 2), "iyz"),
                ((2, 2), "izz"),
            ):
                matrix[i, j] = matrix[j, i] = self.number(inertia, key, default=0.0)
            smallest = float(np.linalg.eigvalsh(matrix)[0])
            if smallest < -1e-9 * max(1e-9, float(np.abs(matrix).max())):
                self.warn(
                    inertia,
                    "inertia of link '%s' has the negative principal moment %g kg m^2; no body has that"
                    % (link, smallest),
                )
        rotation = origin[:3, :3]
        return Inertial(value, origin[:3, 3].copy(), rotation @ matrix @ rotation.T)

    def shape(self, element, looks, link):
        geometry = self.child(element, "geometry")
        shapes = [e for e in geometry if isinstance(e.tag, str)]
        if len(shapes) != 1:
            raise self.error(geometry, "<geometry> of link '%s' holds %d shapes, expected one" % (link, len(shapes)))
        material = element.find("material")
        colour, finish = (None, None) if material is None else self.look(material, looks)
        return Shape(
            self.geometry(shapes[0], link), self.origin(element), element.get("name", ""), colour, link, finish
        )

    def geometry(self, element, link):
        if element.tag == "box":
            return Box(tuple(self.positive(element, "size", 3, link)))
        if element.tag == "cylinder":
            return Cylinder(self.positive(element, "radius", 1, link)[0], self.positive(element, "length", 1, link)[0])
        if element.tag == "sphere":
            return Sphere(self.positive(element, "radius", 1, link)[0])
        if element.tag == "mesh":
            filename = element.get("filename")
            if not filename:
                raise self.error(element, "<mesh> of link '%s' has no filename" % link)
            scale = self.vector(element, "scale", 3, default=(1.0, 1.0, 1.0))
            return Mesh(filename, tuple(scale), element.get("submesh", ""), _is_true(element.get("centred")))
        raise self.error(
            element, "link '%s' has a <%s>; known shapes are box, cylinder, sphere and mesh" % (link, element.tag)
        )

    def joint(self, element):
        name = self.name(element)
        kind = element.get("type")
        if kind not in JOINT_TYPES:
            raise self.error(element, "joint '%s' has type '%s'; known: %s" % (name, kind, ", ".join(JOINT_TYPES)))
        if kind in ("floating", "planar"):
            self.warn(element, "joint '%s' is %s, which nothing here drives; it is held fixed" % (name, kind))
        axis = self.vector(element.find("axis"), "xyz", 3, default=(1.0, 0.0, 0.0))
        length = math.sqrt(sum(a * a for a in axis))
        if length < 1e-9:
            if kind in MOVABLE_TYPES:
                raise self.error(element, "axis of joint '%s' is zero; expected a direction such as 0 0 1" % name)
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
            0.0 if dynamics is None else self.number(dynamics, "damping", default=0.0),
            0.0 if dynamics is None else self.number(dynamics, "friction", default=0.0),
            element.sourceline,
        )

    def limit(self, joint, name, kind):
        element = joint.find("limit")
        if element is None:
            if kind in ("revolute", "prismatic"):
                raise self.error(
                    joint,
                    "%s joint '%s' has no <limit lower= upper= effort= velocity=>; use type continuous for an "
                    "unlimited one" % (kind, name),
                )
            return Limit()
        limit = Limit(velocity=self.number(element, "velocity"), effort=self.number(element, "effort"))
        # Some tools write the largest float for "none".
        limit.velocity, limit.effort = (
            None if value is not None and value > bounds.NO_LIMIT else value
            for value in (limit.velocity, limit.effort)
        )
        for value, what in ((limit.velocity, "velocity"), (limit.effort, "effort")):
            if value is not None and value < 0.0:
                raise self.error(element, "%s limit of joint '%s' is %g; expected 0 or more" % (what, name, value))
        if kind in ("revolute", "prismatic"):
            limit.lower, limit.upper = (
                min(max(self.number(element, key, default=0.0), -bounds.NO_LIMIT), bounds.NO_LIMIT)
                for key in ("lower", "upper")
            )
            if limit.lower > limit.upper:
                raise self.error(
                    element, "joint '%s' has lower limit %g above its upper limit %g" % (name, limit.lower, limit.upper)
                )
        return limit

    def mimic(self, element, name):
        other = element.get("joint")
        if not other:
            raise self.error(element, "<mimic> of joint '%s' has no joint attribute" % name)
        multiplier = self.number(element, "multiplier", default=1.0)
        return Mimic(other, multiplier, self.number(element, "offset", default=0.0))

    def transmission(self, element):
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

    def gazebo_reference(self, element, link):
        """Apply a <gazebo reference="link">: the link's surface, weight and colour."""
        found = {}
        for tag, name in (("mu1", "friction"), ("kp", "stiffness"), ("kd", "damping")):
            # Both spellings of the first one are in use.
            part = element.find(tag) if tag != "mu1" or element.find(tag) is not None else element.find("mu")
            if part is not None:
                text = (part.text or "").strip() or part.get("value", "")
                found[name] = self.parse_float(text, part, part.tag, may_be_infinite=name in MAY_BE_INFINITE)
                if found[name] < 0.0 and name == "friction":
                    found[name] = math.inf  # as Gazebo takes it
                elif found[name] < 0.0:
                    raise self.error(part, "%s of link '%s' is %g; expected 0 or more" % (tag, link.name, found[name]))
        if found:
            link.surface = Surface(**found)
        link.gravity = not _is_true(element.findtext("turnGravityOff"))
        name = (element.findtext("material") or "").strip()
        finish = Finish(emission=GLOWS[name]) if name in GLOWS else None
        for shape in link.visuals:
            shape.colour = shape.colour or MATERIALS.get(name)
            shape.finish = shape.finish or finish

    # -- pieces -------------------------------------------------------------------------------------------------

    def looks(self):
        """Return {name: (rgba or None, Finish or None)} of the materials beside the links."""
        table = {}
        for element in self.root.iterchildren("material"):
            look = self.own_look(element)
            if element.get("name") and look != (None, None):
                table[element.get("name")] = look
        return table

    def look(self, element, looks):
        look = self.own_look(element)
        if look != (None, None):
            # A material may be defined inside the first visual that uses it and be referred to by name afterwards.
            looks.setdefault(element.get("name", ""), look)
            return look
        return looks.get(element.get("name", ""), look)

    def own_look(self, element):
        colour = element.find("color")
        rgba = None if colour is None else tuple(self.vector(colour, "rgba", 4, default=(0.5, 0.5, 0.5, 1.0)))
        texture, emission, gloss = (element.find(tag) for tag in ("texture", "emission", "gloss"))
        if texture is None and emission is None and gloss is None:
            return rgba, None
        none = Finish()
        return rgba, Finish(
            tuple(self.vector(emission, "rgb", 3, default=none.emission)),
            None if gloss is None else self.number(gloss, "value", required=True),
            "" if texture is None else texture.get("filename", ""),
            tuple(self.vector(texture, "repeats", 2, default=none.repeats)),
            *(texture is not None and _is_true(texture.get(key)) for key in ("cut_out", "two_sided")),
        )

    def origin(self, element):
        origin = element.find("origin")
        if origin is None:
            return np.eye(4)
        zero = (0.0, 0.0, 0.0)
        return pose_matrix(self.vector(origin, "xyz", 3, default=zero), self.vector(origin, "rpy", 3, default=zero))

    def name(self, element):
        name = element.get("name")
        if not name:
            raise self.error(element, "<%s> has no name" % element.tag)
        return name

    def child(self, element, tag):
        child = element.find(tag)
        if child is None:
            raise self.error(element, "<%s> has no <%s>" % (element.tag, tag))
        return child

    def link_reference(self, element, role, name):
        link = self.child(element, role).get("link")
        if not link:
            raise self.error(element, "joint '%s' has a <%s> without a link attribute" % (name, role))
        return link

    def positive(self, element, key, count, link):
        values = self.vector(element, key, count)
        if any(value <= 0.0 for value in values):
            raise self.error(
                element,
                "%s of the %s of link '%s' is %s; expected positive numbers"
                % (key, element.tag, link, _words(values)),
            )
        return values

    def vector(self, element, key, count, default=None):
        text = None if element is None else element.get(key)
        if text is None:
            if default is None:
                raise self.error(element, "<%s> has no %s" % (element.tag, key))
            return list(default)
        words = text.split()
        if len(words) != count:
            raise self.error(element, "%s='%s' holds %d numbers, expected %d" % (key, text, len(words), count))
        return [self.parse_float(word, element, key) for word in words]

    def number(self, element, key, default=None, required=False):
        text = element.get(key)
        if text is None:
            if required:
                raise self.error(element, "<%s> has no %s" % (element.tag, key))
            return default
        return self.parse_float(text, element, key)

    def parse_float(self, text, element, key, may_be_infinite=False):
        try:
            value = float(text)
        except ValueError:
            raise self.error(element, "%s='%s' is not a number" % (key, text)) from None
        if not math.isfinite(value) and not (may_be_infinite and math.isinf(value)):
            raise self.error(element, "%s='%s' is not finite" % (key, text))
        return value


def _words(values):
    return " ".join("%g" % value for value in values)


def _is_true(text):
    """Whether a flag of Gazebo's, of which ``text`` is the content or None, is set."""
    return (text or "").strip().lower() in ("true", "1")


def _reduction(text):
    # A wrong transmission does not affect the bodies: controller_manager, which uses it, reports the error.
    try:
        number = float(text)
    except (TypeError, ValueError):
        return 1.0
    return number if math.isfinite(number) else 1.0
