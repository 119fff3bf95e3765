# SPDX-License-Identifier: BSD-3-Clause
"""Read SRDF text. An entry that cannot be used is skipped with a warning: source, line, what was found."""
from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from motion_planning.errors import PlanningError
from motion_planning.srdf.data import (
    VIRTUAL_JOINT_TYPES,
    DisabledPair,
    EndEffector,
    GroupEntry,
    GroupState,
    Srdf,
    VirtualJoint,
)
from urdf_model import UrdfError, XmlRefused, parse_xml

if TYPE_CHECKING:
    from urdf_model import Robot

    Element = Any  # lxml's, which only urdf_model knows


class SrdfError(PlanningError):
    """The text is not SRDF."""


class _Skip(Exception):
    """The entry cannot be used; the text says why."""


def parse_srdf(xml: str | bytes, robot: Robot, source: str = "robot_description_semantic") -> Srdf:
    """Return the :class:`~motion_planning.srdf.Srdf` in ``xml`` (str or bytes), for ``robot`` (urdf_model.Robot).

    ``source`` names the text in messages. Unknown elements are ignored. An entry with an unknown link, joint or group,
    or without a required attribute, is skipped and listed in ``Srdf.warnings``. Raises SrdfError for malformed XML and
    another root element.
    """
    try:
        root = parse_xml(xml)
    except XmlRefused as error:
        raise SrdfError("%s %s" % (source, error)) from None
    if root is None or root.tag != "robot":
        raise SrdfError("%s is not an SRDF: its root element is %s, expected <robot>"
                        % (source, "nothing" if root is None else "<%s>" % root.tag))
    return _Reader(root, robot, source).read()


class _Reader:
    def __init__(self, root: Element, robot: Robot, source: str) -> None:
        self.root, self.robot, self.source = root, robot, source
        self.srdf = Srdf(root.get("name") or robot.name)
        self.unplanned: set[str] = set()  # groups of which nothing is planned for

    def read(self) -> Srdf:
        if self.srdf.name != self.robot.name:
            self.warn(self.root, "it describes robot '%s', but the URDF's name is '%s'; it is used nevertheless"
                      % (self.srdf.name, self.robot.name))
        # Later kinds of entries refer to earlier kinds, in any order in the document.
        for tag, read in (("virtual_joint", self.virtual_joint), ("group", self.group)):
            self.each(tag, read)
        self.drop_unresolved_groups()
        for tag, read in (("group_state", self.group_state), ("end_effector", self.end_effector),
                          ("passive_joint", self.passive_joint), ("disable_collisions", self.disable_collisions),
                          ("enable_collisions", self.enable_collisions),
                          ("disable_default_collisions", self.disable_default_collisions),
                          ("joint_property", self.joint_property),
                          ("link_sphere_approximation", self.link_sphere_approximation)):
            self.each(tag, read)
        return self.srdf

    def each(self, tag: str, read: Callable[[Element], None]) -> None:
        for element in self.root.iterchildren(tag):
            try:
                read(element)
            except _Skip as skip:
                self.warn(element, "%s; this <%s> is skipped" % (skip, tag))

    def warn(self, element: Element, text: str) -> None:
        self.srdf.warnings.append("%s, line %s: %s" % (self.source, element.sourceline, text))

    # -- elements -----------------------------------------------------------------------------------------------

    def virtual_joint(self, element: Element) -> None:
        kind = _attribute(element, "type")
        if kind not in VIRTUAL_JOINT_TYPES:
            raise _Skip("its type is '%s'; expected %s" % (kind, ", ".join(VIRTUAL_JOINT_TYPES)))
        joint = VirtualJoint(_attribute(element, "name"), kind, _attribute(element, "parent_frame"),
                             self.link(element, "child_link"))
        if joint.child_link != self.robot.root:
            raise _Skip("its child link is '%s', but the robot hangs at its root '%s'"
                        % (joint.child_link, self.robot.root))
        if self.srdf.virtual_joints:
            raise _Skip("there is a virtual joint already, '%s'" % self.srdf.virtual_joints[0].name)
        self.srdf.virtual_joints.append(joint)

    def group(self, element: Element) -> None:
        name = _attribute(element, "name")
        if name in self.srdf.groups:
            raise _Skip("group '%s' appears twice (first in line %d)" % (name, self.srdf.groups[name].line))
        found = {"link": [], "joint": [], "chain": [], "group": []}
        readers = {"link": lambda part: self.link(part, "name"), "joint": self.member_joint, "chain": self.chain,
                   "group": lambda part: _attribute(part, "name")}
        for part in element.iterchildren(*readers):
            try:
                item = readers[part.tag](part)
            except _Skip as skip:
                self.warn(part, "%s; it is left out of group '%s'" % (skip, name))
                continue
            if item not in found[part.tag]:
                found[part.tag].append(item)
        if not any(found.values()):
            if any(part.get("name") in self.virtual_names() for part in element.iterchildren("joint")):
                self.unplanned.add(name)
            raise _Skip("group '%s' is empty" % name)
        self.srdf.groups[name] = GroupEntry(name, tuple(found["link"]), tuple(found["joint"]), tuple(found["chain"]),
                                            tuple(found["group"]), element.sourceline)

    def member_joint(self, element: Element) -> str:
        name = _attribute(element, "name")
        if name in self.virtual_names():
            raise _Skip("'%s' is a virtual joint, which is not planned for" % name)
        return self.joint(element, "name")

    def chain(self, element: Element) -> tuple[str, str]:
        base, tip = self.link(element, "base_link"), self.link(element, "tip_link")
        try:
            joints = self.robot.chain(base, tip)
        except UrdfError as error:
            raise _Skip(str(error)) from None
        if not joints:
            raise _Skip("the chain from '%s' to itself holds no joint" % base)
        return base, tip

    def virtual_names(self) -> set[str]:
        return {joint.name for joint in self.srdf.virtual_joints}

    def leave_out_unplanned(self) -> None:
        """Take groups of virtual joints alone, such as a mobile base, out of those that contain them."""
        groups = self.srdf.groups
        while self.unplanned:
            unplanned = self.unplanned.pop()
            for name, group in list(groups.items()):
                if unplanned not in group.subgroups:
                    continue
                rest = replace(group, subgroups=tuple(sub for sub in group.subgroups if sub != unplanned))
                groups[name] = rest
                self.srdf.warnings.append(
                    "%s, line %d: nothing in group '%s' is planned for; it is left out of group '%s'"
                    % (self.source, group.line, unplanned, name))
                if not (rest.links or rest.joints or rest.chains or rest.subgroups):
                    del groups[name]
                    self.unplanned.add(name)

    def drop_unresolved_groups(self) -> None:
        """Skip groups with unknown subgroups, and groups that contain themselves."""
        self.leave_out_unplanned()
        groups, known = self.srdf.groups, set()
        while True:
            new = {name for name, group in groups.items() if name not in known and known.issuperset(group.subgroups)}
            if not new:
                break
            known |= new
        for name in [name for name in groups if name not in known]:
            group = groups.pop(name)
            missing = [sub for sub in group.subgroups if sub not in known]
            self.srdf.warnings.append(
                "%s, line %d: group '%s' contains the group%s %s, not known or containing each other; this <group> is "
                "skipped" % (self.source, group.line, name, "s" if len(missing) > 1 else "",
                             ", ".join("'%s'" % sub for sub in missing)))

    def group_state(self, element: Element) -> None:
        name, group = _attribute(element, "name"), self.group_name(element, "group")
        values = {}
        for part in element.iterchildren("joint"):
            try:
                joint = self.joint(part, "name")
                words = _attribute(part, "value").split()
                if len(words) != 1:
                    raise _Skip("joint '%s' takes one value, got %d" % (joint, len(words)))
                values[joint] = _number(words[0], "value")
            except _Skip as skip:
                self.warn(part, "%s; it is left out of state '%s'" % (skip, name))
        if not values:
            raise _Skip("state '%s' of group '%s' has no joints" % (name, group))
        self.srdf.states.append(GroupState(name, group, values))

    def end_effector(self, element: Element) -> None:
        name, group = _attribute(element, "name"), self.group_name(element, "group")
        parent_group = element.get("parent_group", "")
        if parent_group and parent_group not in self.srdf.groups:
            self.warn(element, "end effector '%s' names parent group '%s', which does not exist; it is ignored"
                      % (name, parent_group))
            parent_group = ""
        self.srdf.end_effectors.append(EndEffector(name, group, self.link(element, "parent_link"), parent_group))

    def passive_joint(self, element: Element) -> None:
        name = _attribute(element, "name")
        if name not in {joint.name for joint in self.srdf.virtual_joints}:
            self.joint(element, "name")
        self.srdf.passive_joints.append(name)

    def disable_collisions(self, element: Element) -> None:
        pair = self.link(element, "link1"), self.link(element, "link2")
        self.srdf.disabled.append(DisabledPair(*pair, element.get("reason", "")))

    def enable_collisions(self, element: Element) -> None:
        self.srdf.enabled.append((self.link(element, "link1"), self.link(element, "link2")))

    def disable_default_collisions(self, element: Element) -> None:
        self.srdf.no_default.append(self.link(element, "link"))

    def joint_property(self, element: Element) -> None:
        joint = _attribute(element, "joint_name")
        if joint not in {virtual.name for virtual in self.srdf.virtual_joints}:
            self.joint(element, "joint_name")
        value = _attribute(element, "value")
        self.srdf.joint_properties.setdefault(joint, {})[_attribute(element, "property_name")] = value

    def link_sphere_approximation(self, element: Element) -> None:
        link, spheres = self.link(element, "link"), []
        for part in element.iterchildren("sphere"):
            centre = tuple(_number(word, "center") for word in _attribute(part, "center").split())
            radius = _number(_attribute(part, "radius"), "radius")
            if len(centre) != 3 or radius < 0.0:
                raise _Skip("a sphere of link '%s' needs three numbers as center and a radius of 0 or more" % link)
            spheres.append((centre, radius))
        if link in self.srdf.spheres:
            raise _Skip("the spheres of link '%s' appear twice" % link)
        self.srdf.spheres[link] = tuple(spheres)

    # -- pieces -------------------------------------------------------------------------------------------------

    def link(self, element: Element, attribute: str) -> str:
        name = _attribute(element, attribute)
        if name not in self.robot.links:
            raise _Skip("link '%s' is not in the URDF" % name)
        return name

    def joint(self, element: Element, attribute: str) -> str:
        name = _attribute(element, attribute)
        if name not in self.robot.joints:
            raise _Skip("joint '%s' is not in the URDF" % name)
        return name

    def group_name(self, element: Element, attribute: str) -> str:
        name = _attribute(element, attribute)
        if name not in self.srdf.groups:
            raise _Skip("group '%s' does not exist" % name)
        return name


def _attribute(element: Element, name: str) -> str:
    value = (element.get(name) or "").strip()
    if not value:
        raise _Skip("<%s> has no %s" % (element.tag, name))
    return value


def _number(text: str, name: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise _Skip("%s='%s' is not a number" % (name, text)) from None
    if not math.isfinite(value):
        raise _Skip("%s='%s' is not finite" % (name, text))
    return value
