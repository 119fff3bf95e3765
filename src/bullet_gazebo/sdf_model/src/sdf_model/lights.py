# SPDX-License-Identifier: BSD-3-Clause
"""The <light> element."""

from dataclasses import dataclass

import numpy as np


@dataclass
class Light:
    """A light as it was written. Colours rgba from 0 to 1, attenuation in 1, 1/m and 1/m^2."""

    name: str
    type: str
    pose: np.ndarray  # 4x4, in the world
    diffuse: tuple
    specular: tuple
    attenuation: tuple  # constant, linear, quadratic
    direction: tuple
    cast_shadows: bool


def read_light(document, element, origin):
    """Return the Light of ``element``; ``origin`` (4x4) is where its <pose> refers to."""
    attenuation = element.find("attenuation")
    factors = (1.0, 0.0, 0.0)  # of SDF's specification
    if attenuation is not None:
        factors = tuple(
            document.number(attenuation, tag, default)
            for tag, default in zip(("constant", "linear", "quadratic"), factors, strict=True)
        )
    return Light(
        document.name(element),
        element.get("type", "point"),
        origin @ document.pose(element),
        colour(document, element, "diffuse", (1.0, 1.0, 1.0, 1.0)),
        colour(document, element, "specular", (0.1, 0.1, 0.1, 1.0)),
        factors,
        document.vector(element, "direction", (0.0, 0.0, -1.0)),
        document.flag(element, "cast_shadows"),
    )


def colour(document, element, tag, default):
    """Return red, green, blue, alpha of a child; alpha may be left out."""
    child = element.find(tag)
    if child is None:
        return default
    values = document.numbers(child, 3 if len((child.text or "").split()) == 3 else 4)
    return values if len(values) == 4 else (*values, 1.0)
