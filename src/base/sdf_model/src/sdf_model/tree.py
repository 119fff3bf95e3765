# SPDX-License-Identifier: BSD-3-Clause
"""Builds the tree of a urdf_model.Robot from links and joints anywhere in a model."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from urdf_model import Gear, Inertial, Joint, Limit, Link, Loop, Robot
from urdf_model.transforms import inverse

from .gears import gear_of

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from .document import Document

WORLD = "world"
# Mass and moments of a link between the axes of a joint, as a part of the lighter link's.
_CROSS_PART = 1e-3


@dataclass
class Dynamics:
    """The <dynamics> of a joint, as ``urdf_model.Joint`` has them."""

    damping: float = 0.0
    friction: float = 0.0
    spring_stiffness: float = 0.0
    spring_reference: float = 0.0


@dataclass
class SdfJoint:
    """A joint as written; frames in the model."""

    name: str
    type: str
    parent: str
    child: str
    frame: np.ndarray  # 4x4
    axis: np.ndarray  # (3,), unit, in the joint's frame
    limit: Limit
    dynamics: Dynamics
    implicit_damping: bool
    element: Any
    follows: Gear | None = None  # of a screw's thread, between its turn and this joint


@dataclass
class ModelParts:
    """The links and joints of a model and of the models in it. Link frames are 4x4, in the model."""

    links: dict = field(default_factory=dict)  # name -> (Link, 4x4)
    joints: list = field(default_factory=list)
    gazebo: list = field(default_factory=list)  # <gazebo> elements, as urdf_model.Robot has them
    gearboxes: list = field(default_factory=list)
    static: bool = False
    static_is_said: bool = False  # whether an element says so


def crosses(joints: Sequence[SdfJoint],
            links: Mapping[str, tuple[Link, np.ndarray]]) -> dict[str, tuple[Link, np.ndarray]]:
    """Return the links between the ``joints`` of one <joint>, as ModelParts has them: so light that they change
    little."""
    inertials = [links[end][0].inertial for end in (joints[0].parent, joints[-1].child) if end in links]
    masses = [inertial for inertial in inertials if inertial is not None]
    if not masses:
        masses = [Inertial(1.0, np.zeros(3), np.eye(3))]
    lightest = min(masses, key=lambda inertial: inertial.mass)
    moment = _CROSS_PART * np.linalg.eigvalsh(lightest.inertia).max()
    found = {}
    for joint in joints[:-1]:
        link = Link(joint.child, Inertial(_CROSS_PART * lightest.mass, np.zeros(3), moment * np.eye(3)),
                    line=joint.element.sourceline, helper=True)
        found[joint.child] = link, joint.frame
    return found


def build_robot(document: Document, name: str, parts: ModelParts) -> Robot:
    """Return the Robot of ``parts``.

    A joint may be written from the child's end: it is reversed, and its position keeps its meaning. Joints that close a
    loop become the Robot's loops, which is noted since they have no state. Links that no joint connects with the root
    are on floating joints; in a static model they are fixed. A model that is welded to the world becomes static, if
    it has no such links.
    """
    links = dict(parts.links)
    held = "fixed" if parts.static else "floating"
    written, root = _without_welds(parts)
    joined = {}
    for joint in written:
        for end in (joint.parent, joint.child):
            if end == WORLD and WORLD not in links:
                # First, since it carries the rest; World keeps a root of this name where it is.
                links = {WORLD: (Link(WORLD), np.eye(4)), **links}
            if end not in links:
                raise document.error(
                    joint.element,
                    "joint '%s' names link '%s', which does not exist; links: %s"
                    % (joint.name, end, ", ".join(parts.links)),
                )
            joined.setdefault(end, []).append(joint)
    root = root or _root(links, written)
    joints, loops, reached, used = {}, [], {root}, set()

    def hang(start):
        """Add all links that are joined to link ``start``, directly or through others."""
        branch = deque([start])
        while branch:
            here = branch.popleft()
            for joint in joined.get(here, ()):
                if joint.name in used:
                    continue
                used.add(joint.name)
                there = joint.child if joint.parent == here else joint.parent
                if there in reached:
                    loops.append(joint)
                    continue
                reached.add(there)
                joints[joint.name] = _joint(links, joint, here, there)
                branch.append(there)

    hang(root)
    for link in _roots_first(links, written):
        if link in reached:
            continue
        reached.add(link)
        joints["%s_held" % link] = _held(links, root, link, held)
        hang(link)
    place = {joint.name: position for position, joint in enumerate(written)}
    ordered = sorted(joints.values(), key=lambda joint: place.get(joint.name, len(place)))
    return Robot(
        name,
        {key: link for key, (link, _) in links.items()},
        {joint.name: joint for joint in ordered},
        root,
        gazebo=parts.gazebo,
        root_origin=links[root][1],
        loops=[loop for joint in loops for loop in _loop(document, links, joint)],
        gears=_gears(document, parts, joints),
        keeps_links=True,
    )


def _gears(document: Document, parts: ModelParts, joints: Mapping[str, Joint]) -> list[Gear]:
    """The Gears between the ``joints`` (by name) of the tree."""
    found = [joint.follows for joint in parts.joints if joint.follows is not None]
    for gearbox in parts.gearboxes:
        try:
            found.append(gear_of(gearbox, parts.joints))
        except ValueError as error:
            document.note(gearbox.element, "gearbox '%s': %s" % (gearbox.name, error))
    return [gear for gear in found if gear.joint in joints and gear.other in joints]


def _without_welds(parts: ModelParts) -> tuple[list[SdfJoint], str | None]:
    """Return the joints without those that fix a link in the world, and that link, which then is a static root.

    Only where the world has no other joint, and all links hang on it; a hinge on the world needs the world as a link.
    """
    welds = [joint for joint in parts.joints if WORLD in (joint.parent, joint.child)]
    anchored = [end for joint in welds for end in (joint.parent, joint.child) if end in parts.links]
    if WORLD in parts.links or not anchored or any(joint.type != "fixed" for joint in welds):
        return parts.joints, None
    if not parts.static and not _reachable(WORLD, parts.joints).issuperset(parts.links):
        return parts.joints, None
    parts.static = True
    return [joint for joint in parts.joints if joint not in welds], anchored[0]


def _root(links: Mapping[str, tuple[Link, np.ndarray]], joints: Sequence[SdfJoint]) -> str:
    """Return the root link: the world, or the first one that is not a joint's child among those that are joined to the
    first link, with which Gazebo's model goes."""
    if WORLD in links:
        return WORLD
    near = _reachable(next(iter(links)), joints)
    return next(name for name in _roots_first(links, joints) if name in near)


def _roots_first(links: Iterable[str], joints: Iterable[SdfJoint]) -> list[str]:
    """The links, those first that are not a joint's child."""
    children = {joint.child for joint in joints}
    return sorted(links, key=lambda name: name in children)


def _reachable(start: str, joints: Iterable[SdfJoint]) -> set[str]:
    """The links that are joined to ``start``, directly or through others, and itself."""
    beside = {}
    for joint in joints:
        beside.setdefault(joint.parent, []).append(joint.child)
        beside.setdefault(joint.child, []).append(joint.parent)
    found, branch = {start}, [start]
    while branch:
        new = [link for link in beside.get(branch.pop(), ()) if link not in found]
        found.update(new)
        branch += new
    return found


def _joint(links: Mapping[str, tuple[Link, np.ndarray]], joint: SdfJoint, parent: str, child: str) -> Joint:
    turned = parent != joint.parent
    return Joint(
        joint.name,
        joint.type,
        parent,
        child,
        inverse(links[parent][1]) @ joint.frame,
        -joint.axis if turned else joint.axis,
        joint.limit,
        **vars(joint.dynamics),
        implicit_damping=joint.implicit_damping,
        line=joint.element.sourceline,
        child_offset=inverse(joint.frame) @ links[child][1],
    )


def _loop(document: Document, links: Mapping[str, tuple[Link, np.ndarray]], joint: SdfJoint) -> list[Loop]:
    """[the Loop of a joint beside the tree], or [] for one of a kind that is held fixed elsewhere; it is noted."""
    kind = joint.type
    if kind == "fixed" and joint.element.get("type") != "fixed":
        document.note(joint.element, "joint '%s', which closes a loop" % joint.name)
        return []
    if joint.parent == joint.child:
        document.note(joint.element, "joint '%s' of a link with itself" % joint.name)
        return []
    if kind != "fixed":
        document.note(joint.element, "limits, dynamics and state of joint '%s', which closes a loop" % joint.name)
    return [Loop(joint.name, kind, joint.parent, joint.child, inverse(links[joint.parent][1]) @ joint.frame,
                 inverse(links[joint.child][1]) @ joint.frame, joint.axis)]


def _held(links: Mapping[str, tuple[Link, np.ndarray]], root: str, link: str, kind: str) -> Joint:
    return Joint(
        "%s_held" % link, kind, root, link, inverse(links[root][1]) @ links[link][1], np.array([0.0, 0.0, 1.0])
    )
