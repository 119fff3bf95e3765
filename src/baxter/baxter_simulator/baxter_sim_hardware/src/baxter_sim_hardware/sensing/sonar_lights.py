# SPDX-License-Identifier: BSD-3-Clause
"""How the lights around the head look: a yellow one for each sonar, and below them the halo, a line of red and green.

They are a band around the ring of sonars, which the description has as a cylinder. The sizes and colours of the lights
are a choice.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from urdf_model import Cylinder

from .sensors import MAX_LEVEL, SONAR_COUNT

if TYPE_CHECKING:
    from urdf_model import Link

#: Columns and rows of the band.
PIXELS = (720, 20)
# Distance of the band outside of the cylinder, so that this does not hide it [m].
_OUTSIDE_M = 0.0005
_YELLOW = (255, 200, 40)
_RED, _GREEN = (255, 0, 0), (0, 255, 0)
# Columns of one sonar's light; rows of these lights and of the halo.
_LIGHT_COLUMNS, _LIGHT_ROWS, _HALO_ROWS = 12, slice(2, 10), slice(13, 18)


def around(link: Link) -> tuple[np.ndarray, tuple[float, float], float] | None:
    """The band's place on the ring, a urdf_model.Link: (pose (4, 4) of the cylinder's centre, y upwards, z ahead, where
    the first sonar is; width and height [m]; radius [m]). None for a ring that is not one cylinder."""
    shapes = link.visuals
    if len(shapes) != 1 or not isinstance(shapes[0].geometry, Cylinder):
        return None
    radius = shapes[0].geometry.radius + _OUTSIDE_M
    pose = np.eye(4)
    pose[:3, :3] = np.transpose([(0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)])
    return shapes[0].origin @ pose, (2.0 * np.pi * radius, shapes[0].geometry.length), radius


def picture(mask: int, red: float, green: float) -> np.ndarray:
    """The glow, uint8 (rows, columns, 3); black does not glow. mask: a bit for each sonar's light; red, green: the
    halo's levels, 0 to 100."""
    columns, rows = PIXELS
    pixels = np.zeros((rows, columns, 3), dtype=np.uint8)
    for sonar in range(SONAR_COUNT):
        if mask >> sonar & 1:
            # Sonars are numbered to the left as the robot sees it, which is to the right in the picture.
            middle = columns // 2 + sonar * columns // SONAR_COUNT
            light = np.arange(middle - _LIGHT_COLUMNS // 2, middle + _LIGHT_COLUMNS // 2) % columns
            pixels[_LIGHT_ROWS, light] = _YELLOW
    pixels[_HALO_ROWS] = (red * np.array(_RED) + green * np.array(_GREEN)) / MAX_LEVEL
    return pixels
