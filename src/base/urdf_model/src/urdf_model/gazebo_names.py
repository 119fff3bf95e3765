# SPDX-License-Identifier: BSD-3-Clause
"""The links and collisions that Gazebo makes of a description, and their names.

From a URDF, Gazebo makes one link of what fixed joints hold together, unless a joint is preserved or holds a link on
the world; the links of an SDF all stay. Names as sdformat's reader of URDF gives them.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from .model import Robot

WORLD = "world"


class CollisionName(NamedTuple):
    """A collision as Gazebo names it."""

    link: str  # Gazebo's link
    name: str


def gazebo_links(robot: Robot) -> dict[str, str]:
    """Return {link: Gazebo's link that it is a part of}, parents first; without a root that stands for the world."""
    children = {name: [] for name in robot.links}
    for joint in robot.joints.values():
        children[joint.parent].append(joint)
    found: dict[str, str] = {}
    stack = [(robot.root, robot.root)]
    while stack:
        link, part_of = stack.pop()
        if (link != WORLD or part_of != WORLD) and not robot.links[link].helper:
            found[link] = part_of
        for joint in reversed(children[link]):
            stays = joint.type != "fixed" or joint.preserved or robot.keeps_links or part_of == WORLD
            stack.append((joint.child, joint.child if stays else part_of))
    return found


def collision_names(robot: Robot) -> dict[tuple[str, int], CollisionName]:
    """Return {(link, number of a collision in it): CollisionName}."""
    links = gazebo_links(robot)
    if robot.keeps_links:
        return {(link, number): CollisionName(link, shape.name or "collision")
                for link in links for number, shape in enumerate(robot.links[link].collisions)}
    found, counts = {}, {}
    for link in in_gazebos_order(robot):
        if link not in links:
            continue
        whole = links[link]
        for number, shape in enumerate(robot.links[link].collisions):
            count = counts[whole] = counts.get(whole, -1) + 1
            name = "%s_collision%s" % (shape.name or link, "_%d" % count if count else "")
            if not name.startswith(whole):
                name = "%s_fixed_joint_lump__%s" % (whole, name)
            found[link, number] = CollisionName(whole, name)
    return found


def in_gazebos_order(robot: Robot) -> Iterator[str]:
    """The links in the order in which urdfdom has them: parents first, children by the names of their joints."""
    children = {name: [] for name in robot.links}
    for joint in sorted(robot.joints.values(), key=lambda joint: joint.name, reverse=True):
        children[joint.parent].append(joint.child)
    stack = [robot.root]
    while stack:
        link = stack.pop()
        yield link
        stack += children[link]
