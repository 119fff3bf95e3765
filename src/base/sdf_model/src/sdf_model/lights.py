# SPDX-License-Identifier: BSD-3-Clause
"""The <light> element, and the light settings of <scene>."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from .document import Document, Notes, Triple

if TYPE_CHECKING:
    from lxml import etree

Rgba = tuple[float, float, float, float]
Default = TypeVar("Default", bound=Rgba | None)


@dataclass
class Light:
    """A light as it was written. Colours rgba from 0 to 1, attenuation in 1, 1/m and 1/m^2."""

    name: str
    type: str
    pose: np.ndarray  # 4x4, in the world
    diffuse: Rgba
    specular: Rgba
    attenuation: Triple  # constant, linear, quadratic
    direction: Triple  # in the frame of its pose
    cast_shadows: bool
    range_m: float = 10.0  # further away it lights nothing
    spot: Triple | None = None  # of a spot light: inner angle, outer angle [rad, of the whole cone], falloff


@dataclass
class SceneLook:
    """Ambient light, background, sky and shadows of a world. Colours red, green, blue from 0 to 1; None: not given."""

    ambient: Triple | None = None
    background: Triple | None = None
    shadows: bool = True
    sky: bool = False


def read_light(document: Document, element: etree._Element, origin: np.ndarray) -> Light:
    """Return the Light of ``element``; ``origin`` (4x4) is where its <pose> refers to."""
    attenuation = element.find("attenuation")
    factors = (1.0, 0.0, 0.0)  # of SDF's specification, as the other defaults
    range_m = Light.range_m
    if attenuation is not None:
        range_m = document.number(attenuation, "range", range_m)
        constant, linear, quadratic = factors
        factors = (document.number(attenuation, "constant", constant), document.number(attenuation, "linear", linear),
                   document.number(attenuation, "quadratic", quadratic))
    spot = element.find("spot")
    return Light(
        document.name(element),
        element.get("type", "point"),
        origin @ document.pose(element),
        colour(document, element, "diffuse", (1.0, 1.0, 1.0, 1.0)),
        colour(document, element, "specular", (0.1, 0.1, 0.1, 1.0)),
        factors,
        document.vector(element, "direction", (0.0, 0.0, -1.0)),
        document.flag(element, "cast_shadows"),
        range_m,
        None if spot is None else (document.number(spot, "inner_angle", 0.0), document.number(spot, "outer_angle", 0.0),
                                   document.number(spot, "falloff", 0.0)),
    )


def read_scene(document: Document, element: etree._Element) -> SceneLook:
    """Return the SceneLook of the ``<scene>`` element."""
    ambient, background = (colour(document, element, tag, None) for tag in ("ambient", "background"))
    return SceneLook(
        None if ambient is None else ambient[:3],
        None if background is None else background[:3],
        document.flag(element, "shadows", True),
        element.find("sky") is not None,
    )


def parse_light(xml: bytes, source: str) -> Light:
    """Return the Light of the text of one <light>; its pose is in the frame of the link that it is in.

    Raises SdfError. ``source`` names the text in messages.
    """
    document = Document(b"<sdf>%s</sdf>" % xml, source, None, Notes())
    return read_light(document, document.root.find("light"), np.eye(4))


def colour(document: Document, element: etree._Element, tag: str, default: Default) -> Rgba | Default:
    """Return red, green, blue, alpha of a child; alpha may be left out."""
    child = element.find(tag)
    if child is None:
        return default
    if len((child.text or "").split()) == 3:
        return (*document.numbers(child, 3), 1.0)
    return document.numbers(child, 4)
