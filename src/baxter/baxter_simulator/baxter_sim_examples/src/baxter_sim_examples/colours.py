# SPDX-License-Identifier: BSD-3-Clause
"""Patches of one colour in a camera's picture, by thresholds on hue, saturation and value. Free of ROS."""
from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import cv2
import numpy as np

if TYPE_CHECKING:
    from .looking import CameraView

#: Ranges of hue [half degrees, as OpenCV counts: 0 to 179] of each colour.
HUES = {"red": ((0, 8), (172, 179)), "yellow": ((22, 34),), "green": ((45, 80),), "blue": ((105, 130),)}
# Grey things have a low saturation, dark ones no certain hue [of 255].
_SATURATED, _BRIGHT = 120, 50
# A block shows some of its sides beside its upper face, and something may hide a little of it: shares of that face.
_BLOCK_AREAS = (0.8, 2.5)


class ColourPatch(NamedTuple):
    """A patch of one colour: its middle [pixels] and its area [square pixels]."""

    u: float
    v: float
    area: float


def find_patches(picture: np.ndarray, colour: str, least_area: float = 40.0) -> list[ColourPatch]:
    """Patches of `colour`, one of :data:`HUES`, in a picture (height, width, 3) uint8 red, green, blue, the largest
    first; smaller ones than `least_area` [square pixels] are left out. ``ValueError`` for an unknown colour."""
    if colour not in HUES:
        raise ValueError("colour '%s' is not known; expected one of %s" % (colour, ", ".join(HUES)))
    hsv = cv2.cvtColor(np.ascontiguousarray(picture), cv2.COLOR_RGB2HSV)
    mask = sum(cv2.inRange(hsv, (low, _SATURATED, _BRIGHT), (high, 255, 255)) for low, high in HUES[colour])
    outlines, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    found = []
    for outline in outlines:
        moments = cv2.moments(outline)
        if moments["m00"] >= least_area:
            found.append(ColourPatch(moments["m10"] / moments["m00"], moments["m01"] / moments["m00"], moments["m00"]))
    return sorted(found, key=lambda patch: -patch.area)


def find_blocks(view: CameraView, colour: str, side_m: float, top_m: float) -> list[tuple[float, float, ColourPatch]]:
    """[(x, y [m] in `base`, ColourPatch)] of the patches of `colour` in a `looking.CameraView` that are as large as
    blocks of `side_m` [m] whose upper faces are at height `top_m` [m] in `base`; so the robot itself, which is red, is
    left out. ``ValueError`` for an unknown colour."""
    patches = find_patches(view.picture, colour)
    # A pixel's area at that height, from its places and those of its neighbours: smaller below the camera than aside.
    middles = np.array([patch[:2] for patch in patches]).reshape(-1, 2)
    places = view.on_plane(middles, top_m)
    right = view.on_plane(middles + (0.5, 0.0), top_m) - view.on_plane(middles - (0.5, 0.0), top_m)
    down = view.on_plane(middles + (0.0, 0.5), top_m) - view.on_plane(middles - (0.0, 0.5), top_m)
    pixel_m2 = np.abs(right[:, 0] * down[:, 1] - right[:, 1] * down[:, 0])
    found = []
    for patch, (x, y), area in zip(patches, places, pixel_m2, strict=True):
        if _BLOCK_AREAS[0] < patch.area * area / side_m ** 2 < _BLOCK_AREAS[1]:
            found.append((float(x), float(y), patch))
    return found
