# SPDX-License-Identifier: BSD-3-Clause
"""The <light> element, and the light settings of <scene>."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .document import Document, Notes

if TYPE_CHECKING:
    from lxml import etree


@dataclass
class Light:
    """A light as it was written. Colours rgba from 0 to 1, attenuation in 1, 1/m and 1/m^2."""

    name: str
    type: str
    pose: np.ndarray  # 4x4, in the world
    diffuse: tuple
    specular: tuple
    attenuation: tuple  # constant, linear, quadratic
    direction: tuple  # in the frame of its pose
    cast_shadows: bool
    range_m: float = 10.0  # further away it lights nothing
    spot: tuple | None = None  # of a spot light: inner angle, outer angle [rad, of the whole cone], falloff


@dataclass
class Scene:
    """Ambient light, background, sky and shadows of a world. Colours red, green, blue from 0 to 1; None: not given."""

    ambient: tuple | None = None
    background: tuple | None = None
    shadows: bool = True
    sky: bool = False


def read_light(document: Document, element: etree._Element, origin: np.ndarray) -> Light:
    """Return the Light of ``element``; ``origin`` (4x4) is where its <pose> refers to."""
    attenuation = element.find("attenuation")
    factors = (1.0, 0.0, 0.0)  # of SDF's specification, as the other defaults
    range_m = Light.range_m
    if attenuation is not None:
        range_m = document.number(attenuation, "range", range_m)
        factors = tuple(
            document.number(attenuation, tag, default)
            for tag, default in zip(("constant", "linear", "quadratic"), factors, strict=True)
        )
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
        None if spot is None else tuple(
            document.number(spot, tag, default)
            for tag, default in (("inner_angle", 0.0), ("outer_angle", 0.0), ("falloff", 0.0))
        ),
    )


def read_scene(document: Document, element: etree._Element) -> Scene:
    """Return the Scene of the ``<scene>`` element."""
    return Scene(
        *(None if element.find(tag) is None else colour(document, element, tag, None)[:3]
          for tag in ("ambient", "background")),
        document.flag(element, "shadows", True),
        element.find("sky") is not None,
    )


def parse_light(xml: bytes, source: str) -> Light:
    """Return the Light of the text of one <light>; its pose is in the frame of the link that it is in.

    Raises SdfError. ``source`` names the text in messages.
    """
    document = Document(b"<sdf>%s</sdf>" % xml, source, None, Notes())
    return read_light(document, document.root.find("light"), np.eye(4))


def colour(document: Document, element: etree._Element, tag: str, default: tuple | None) -> tuple | None:
    """Return red, green, blue, alpha of a child; alpha may be left out."""
    child = element.find(tag)
    if child is None:
        return default
    values = document.numbers(child, 3 if len((child.text or "").split()) == 3 else 4)
    return values if len(values) == 4 else (*values, 1.0)
