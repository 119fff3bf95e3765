# SPDX-License-Identifier: BSD-3-Clause
"""Descriptions of things that are made of boxes and cylinders, as URDF."""
from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np

WOOD, STEEL, RED = (0.72, 0.45, 0.25, 1.0), (0.55, 0.57, 0.62, 1.0), (0.75, 0.20, 0.16, 1.0)


class SolidPart(NamedTuple):
    """A box of `size` (3,), or a cylinder (radius, length) along z, [m], with its middle at `place` (3,) [m];
    density [kg/m^3]."""

    size: tuple
    place: tuple
    density: float = 1000.0

    @property
    def mass_kg(self) -> float:
        """[kg]."""
        if len(self.size) == 3:
            return self.density * float(np.prod(self.size))
        return self.density * np.pi * self.size[0] ** 2 * self.size[1]

    def inertia(self) -> np.ndarray:
        """(3, 3) about its middle [kg m^2]."""
        if len(self.size) == 3:
            square = np.square(self.size)
            return self.mass_kg * np.diag(square.sum() - square) / 12.0
        radius, length = self.size
        across = (3.0 * radius**2 + length**2) / 12.0
        return self.mass_kg * np.diag([across, across, 0.5 * radius**2])


class CompositeBody(NamedTuple):
    """A body of several parts; friction: None for the world's usual."""

    parts: Sequence[SolidPart]
    colour: tuple = WOOD
    friction: float | None = None


class Slide(NamedTuple):
    """A joint along `axis` (3,) between two links, from 0 to `travel` [m], with friction [N] and damping [N s/m]."""

    parent: str
    child: str
    axis: tuple
    travel: float
    friction: float
    damping: float


def urdf(name: str, links: dict[str, CompositeBody], slides: Sequence[Slide] = ()) -> str:
    """The description of a thing; the first link is its root."""
    robot = ElementTree.Element("robot", name=name)
    for link_name, link in links.items():
        _add_link(robot, link_name, link)
    for slide in slides:
        joint = ElementTree.SubElement(robot, "joint", name="%s_slide" % slide.child, type="prismatic")
        ElementTree.SubElement(joint, "parent", link=slide.parent)
        ElementTree.SubElement(joint, "child", link=slide.child)
        ElementTree.SubElement(joint, "axis", xyz=_text(slide.axis))
        ElementTree.SubElement(joint, "limit", lower="0", upper=repr(slide.travel), effort="1000", velocity="10")
        ElementTree.SubElement(joint, "dynamics", friction=repr(slide.friction), damping=repr(slide.damping))
    return ElementTree.tostring(robot, encoding="unicode")


def _text(numbers: Iterable[float]) -> str:
    return " ".join(repr(float(number)) for number in numbers)


def _add_link(robot: ElementTree.Element, name: str, body: CompositeBody) -> None:
    link = ElementTree.SubElement(robot, "link", name=name)
    masses = [part.mass_kg for part in body.parts]
    total = sum(masses)
    centre = sum((mass * np.array(part.place) for mass, part in zip(masses, body.parts, strict=True)),
                 np.zeros(3)) / total
    inertia = np.zeros((3, 3))
    for mass, part in zip(masses, body.parts, strict=True):
        off = np.array(part.place) - centre
        inertia += part.inertia() + mass * ((off @ off) * np.eye(3) - np.outer(off, off))
    element = ElementTree.SubElement(link, "inertial")
    ElementTree.SubElement(element, "origin", xyz=_text(centre))
    ElementTree.SubElement(element, "mass", value=repr(float(total)))
    ElementTree.SubElement(element, "inertia", {
        "i" + "xyz"[a] + "xyz"[b]: repr(float(inertia[a, b])) for a in range(3) for b in range(a, 3)})
    for number, part in enumerate(body.parts):
        for tag in ("visual", "collision"):
            shape = ElementTree.SubElement(link, tag, name="%s_%d" % (name, number))
            ElementTree.SubElement(shape, "origin", xyz=_text(part.place))
            geometry = ElementTree.SubElement(shape, "geometry")
            if len(part.size) == 3:
                ElementTree.SubElement(geometry, "box", size=_text(part.size))
            else:
                ElementTree.SubElement(geometry, "cylinder", radius=repr(part.size[0]), length=repr(part.size[1]))
            if tag == "visual":
                material = ElementTree.SubElement(shape, "material", name="%s_colour" % name)
                ElementTree.SubElement(material, "color", rgba=_text(body.colour))
    if body.friction is not None:
        surface = ElementTree.SubElement(robot, "gazebo", reference=name)
        for tag in ("mu1", "mu2"):
            ElementTree.SubElement(surface, tag).text = repr(body.friction)
