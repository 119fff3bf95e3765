# SPDX-License-Identifier: BSD-3-Clause
"""Merge links that fixed joints hold together into one body each.

PyBullet's own merging drops centres of mass (bulletphysics/bullet3 pull request 4683), which makes gravity torques of a
Baxter arm wrong by up to 1.7 Nm; so we merge here, by the parallel-axis theorem.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from .gazebo_names import gazebo_links
from .model import Gear, Inertial, Joint, Loop, Robot, Shape, Surface


class MergedFrame(NamedTuple):
    """The place of an original link: the body that it belongs to, and its frame (4x4) in that body's frame."""

    link: str
    offset: np.ndarray


class SurfacePatch(NamedTuple):
    """Some of a body's collisions, with a surface of their own."""

    surface: Surface
    collisions: list[Shape]


@dataclass
class MergedLink:
    """A body: named after the link that its movable joint moves (or the root), with everything fixed to it.

    Its frame is that of its joint; the bodies of roots have the model's frame. In a URDF that is the frame of the link
    that it is named after, but for loose ones. ``surface`` is the first one that a member has, ``patches`` are the
    collisions that have another. ``weightless``: mass and centre of the members without weight, where others have it.
    """

    name: str
    inertial: Inertial
    visuals: list[Shape] = field(default_factory=list)
    collisions: list[Shape] = field(default_factory=list)
    members: list[str] = field(default_factory=list)
    surface: Surface | None = None
    gravity: bool = True
    self_collide: bool = False
    decay: tuple[float, float] = (0.0, 0.0)
    weightless: Inertial | None = None
    patches: list[SurfacePatch] = field(default_factory=list)

    def own_collisions(self) -> list[Shape]:
        """The collisions that have ``surface``."""
        elsewhere = {id(shape) for patch in self.patches for shape in patch.collisions}
        return [shape for shape in self.collisions if id(shape) not in elsewhere]


@dataclass
class MergedRobot:
    """Bodies and the movable joints between them. Joint parents and origins refer to bodies, not to original links."""

    name: str
    root: str
    links: dict[str, MergedLink]
    joints: dict[str, Joint]
    frames: dict[str, MergedFrame]
    loops: list[Loop] = field(default_factory=list)
    gears: list[Gear] = field(default_factory=list)
    loose: tuple[str, ...] = ()  # roots of further trees, which move freely

    @property
    def roots(self) -> tuple[str, ...]:
        """The bodies that no joint holds; the first is ``root``."""
        return (self.root, *self.loose)


def merge_fixed(robot: Robot, held: bool = False) -> MergedRobot:
    """Return ``robot`` with its fixed joints removed; bodies come parents first, joints in that same order.

    A body behind a floating or planar joint is loose, since Gazebo makes no joint of these; if ``held``, as in a static
    model, it is fixed. The frame of a loose body is the model's with all joints at 0, as the root's is.
    """
    children: dict[str, list[Joint]] = {name: [] for name in robot.links}
    for joint in robot.joints.values():
        children[joint.parent].append(joint)

    frames: dict[str, MergedFrame] = {}
    groups: dict[str, list[str]] = {}
    joints: dict[str, Joint] = {}
    loose: list[str] = []
    at_zero = {robot.root: np.eye(4)}  # frames of bodies in the model's

    # Depth first, so that an arm's bodies are neighbours; the stack keeps document order among siblings.
    stack = [(robot.root, robot.root, robot.root_origin)]
    while stack:
        link, body, offset = stack.pop()
        frames[link] = MergedFrame(body, offset)
        groups.setdefault(body, []).append(link)
        for joint in reversed(children[link]):
            origin = offset @ joint.origin
            if joint.movable:
                stack.append((joint.child, joint.child, joint.child_offset))
                at_zero[joint.child] = at_zero[body] @ origin
                joints[joint.child] = Joint(
                    **{**vars(joint), "parent": body, "origin": origin, "child_offset": np.eye(4)}
                )
            elif joint.type != "fixed" and not held:
                loose.append(joint.child)
                at_zero[joint.child] = np.eye(4)
                stack.append((joint.child, joint.child, at_zero[body] @ origin @ joint.child_offset))
            else:
                stack.append((joint.child, body, origin @ joint.child_offset))

    wholes = gazebo_links(robot)
    links = {body: _merge_group(robot, body, members, frames, wholes) for body, members in groups.items()}
    ordered = {joints[body].name: joints[body] for body in links if body in joints}
    loops = [replace(loop, parent=frames[loop.parent].link, child=frames[loop.child].link,
                     in_parent=frames[loop.parent].offset @ loop.in_parent,
                     in_child=frames[loop.child].offset @ loop.in_child) for loop in robot.loops]
    loops = [loop for loop in loops if loop.parent != loop.child]
    gears = [gear for gear in robot.gears if gear.joint in ordered and gear.other in ordered]
    return MergedRobot(robot.name, robot.root, links, ordered, frames, loops, gears,
                       tuple(body for body in links if body in loose))


def _merge_group(robot, body, members, frames, wholes):
    visuals, collisions = [], []
    parts = {}  # member -> (mass, centre, inertia)
    for name in members:
        link, offset = robot.links[name], frames[name].offset
        for source, target in ((link.visuals, visuals), (link.collisions, collisions)):
            target.extend(
                replace(shape, origin=offset @ shape.origin, link=name) for shape in source
            )
        if link.inertial is not None:
            rotation = offset[:3, :3]
            centre = rotation @ link.inertial.centre + offset[:3, 3]
            parts[name] = link.inertial.mass, centre, rotation @ link.inertial.inertia @ rotation.T
    merged = MergedLink(body, combine([*parts.values()]), visuals, collisions, list(members))
    said = [name for name in members if robot.links[name].surface is not None]
    said.sort(key=lambda name: not robot.links[name].collisions)  # the first with shapes, if one has any
    if said:
        merged.surface = _turned(robot.links[said[0]].surface, frames[said[0]].offset)
    for shape in merged.collisions:
        surface = shape.surface or robot.links[shape.link].surface or Surface()
        surface = _turned(surface, frames[shape.link].offset)
        if not _alike(surface, merged.surface or Surface()):
            same = next((patch for patch in merged.patches if _alike(patch.surface, surface)), None)
            if same is None:
                merged.patches.append(SurfacePatch(surface, [shape]))
            else:
                same.collisions.append(shape)
    # What holds for a whole link of Gazebo's, of which a body can have several.
    whole = {name: robot.links[wholes.get(name, name)] for name in members}
    floats = [name for name in members if not whole[name].gravity]
    merged.gravity = len(floats) < len(members)
    if merged.gravity and any(parts[name][0] > 0.0 for name in floats if name in parts):
        merged.weightless = combine([parts[name] for name in floats if name in parts])
    if any(any(link.decay) for link in whole.values()):
        shares = [parts[name][0] if name in parts else 0.0 for name in members]
        merged.decay = tuple(np.average([whole[name].decay for name in members], axis=0,
                                        weights=shares if sum(shares) > 0.0 else None).tolist())
    merged.self_collide = any(link.self_collide for link in whole.values())
    return merged


def _turned(surface, offset):
    """A Surface of a member at ``offset`` (4, 4) in its body, in the axes of that."""
    if surface.direction is None:
        return surface
    return replace(surface, direction=tuple((offset[:3, :3] @ surface.direction).tolist()))


def _alike(one, other):
    """Whether two Surfaces are the same, with what Gazebo has where nothing is said."""
    def filled(surface):
        mu = 1.0 if surface.friction is None else surface.friction
        return replace(surface, friction=mu,
                       friction_across=mu if surface.friction_across is None else surface.friction_across)

    return filled(one) == filled(other)


def combine(parts: Sequence[tuple[float, np.ndarray, np.ndarray]]) -> Inertial:
    """Return the Inertial of several rigidly joined parts, each (mass, centre (3,), inertia (3, 3) about its centre).

    All in one frame. Huygens-Steiner: I = sum(I_i + m_i (|d|^2 E - d d^T)), d from the common centre of mass.
    """
    mass = sum(part[0] for part in parts)
    if mass <= 0.0:
        inertia = sum((part[2] for part in parts), np.zeros((3, 3)))
        return Inertial(0.0, np.zeros(3), inertia)
    centre = sum((m * c for m, c, _ in parts), np.zeros(3)) / mass
    inertia = np.zeros((3, 3))
    for m, c, i in parts:
        d = c - centre
        inertia += i + m * ((d @ d) * np.eye(3) - np.outer(d, d))
    return Inertial(mass, centre, inertia)
