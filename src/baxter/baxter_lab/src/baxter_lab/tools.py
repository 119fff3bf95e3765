# SPDX-License-Identifier: BSD-3-Clause
"""Tools that are fixed to the hands of the robot."""
from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from lxml import etree

from baxter_model import SIDES
from urdf_model import parse_xml

from .errors import LabError


class Tool(NamedTuple):
    """side: of the arm; description: URDF of one body; place (3,) [m], rpy (3,) [rad]: of its root link in the frame
    `<side>_hand`, whose z points out of the hand."""

    side: str
    description: str
    place: Sequence[float] = (0.0, 0.0, 0.0)
    rpy: Sequence[float] = (0.0, 0.0, 0.0)


def root_of(urdf: str) -> etree._Element:
    """The root element of a description. Raises LabError where it holds none, urdf_model.XmlRefused."""
    root = parse_xml(urdf)
    if root is None:
        raise LabError("a description holds no XML element; expected <robot name=\"...\">")
    return root


def with_tools(robot: str, tools: Sequence[Tool]) -> str:
    """The robot's URDF with the tools on its hands. Their links belong to the robot: its controllers know of the
    weight, and they collide as the hand does. Raises LabError for an unknown side, and for a name that is taken."""
    if not tools:
        return robot
    root = root_of(robot)
    names = {link.get("name") for link in root.findall("link")}
    for tool in tools:
        if tool.side not in SIDES:
            raise LabError("a tool's side is %r; choices are %s" % (tool.side, ", ".join(SIDES)))
        described = root_of(tool.description)
        links = [link.get("name") for link in described.findall("link")]
        if len(links) != 1 or links[0] in names:
            raise LabError("a tool is one link with a name that the robot does not have; found %s"
                           % (", ".join(links) or "none"))
        names.update(links)
        root.extend(described)
        joint = etree.SubElement(root, "joint", name="%s_fixed" % links[0], type="fixed")
        etree.SubElement(joint, "parent", link="%s_hand" % tool.side)
        etree.SubElement(joint, "child", link=links[0])
        etree.SubElement(joint, "origin", xyz="%r %r %r" % tuple(map(float, tool.place)),
                         rpy="%r %r %r" % tuple(map(float, tool.rpy)))
    return etree.tostring(root, encoding="unicode")
