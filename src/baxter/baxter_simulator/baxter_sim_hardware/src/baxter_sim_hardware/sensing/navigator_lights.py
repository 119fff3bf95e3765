# SPDX-License-Identifier: BSD-3-Clause
"""How the lights of the navigators look: a ring around the wheel, and an oval around the buttons.

Sizes are measured on the vendor's meshes, in the frame that the description has for each navigator: z outwards, the
wheel near the origin. No source gives the colour; white with a little blue is a choice.
"""

from __future__ import annotations

import numpy as np

from .panel import NAVIGATORS

#: The frame of each of panel.NAVIGATORS in the description.
LINKS = {name: "%s_itb" % (name.split("_")[-1] + ("_torso" if "torso" in name else "_arm")) for name in NAVIGATORS}
# The wheel's middle along y of the frame [m], on arms and torso.
_ARM_WHEEL_M, _TORSO_WHEEL_M = 0.0043, -0.0092
#: The rectangle of the lights, around the wheel's middle: its height above the frame [m], just above the plate around
#: the wheel; width and height [m]; columns and rows.
ABOVE_M, SIZE_M, PIXELS = 0.0195, (0.064, 0.104), (128, 208)
_COLOUR = (190, 225, 255)
# Half the width of a drawn line; radius of the inner ring; of the outer one, half the length of its straight sides and
# its radius [m].
_HALF_LINE_M, _INNER_M, _STRAIGHT_M, _OUTER_M = 0.0015, 0.0235, 0.0205, 0.0285


def place(navigator: str) -> np.ndarray:
    """The pose (4, 4) of the rectangle's centre in the frame of a navigator, one of panel.NAVIGATORS; x to the right
    and y up for a viewer."""
    above = np.eye(4)
    above[1, 3] = _TORSO_WHEEL_M if navigator.startswith("torso") else _ARM_WHEEL_M
    above[2, 3] = ABOVE_M
    return above


def picture(inner: bool, outer: bool) -> np.ndarray:
    """The glow as a picture, uint8 (rows, columns, 3), with each light on or off; black does not glow."""
    (columns, rows), (width, height) = PIXELS, SIZE_M
    x = ((np.arange(columns) + 0.5) / columns - 0.5) * width
    y = (((np.arange(rows) + 0.5) / rows - 0.5) * height)[:, None]
    beyond = np.maximum(np.abs(y) - _STRAIGHT_M, 0.0)
    lit = np.zeros((rows, columns))
    for on, distance in ((inner, np.hypot(x, y) - _INNER_M), (outer, np.hypot(x, beyond) - _OUTER_M)):
        if on:
            # Smooth over one pixel.
            lit = np.maximum(lit, np.clip((_HALF_LINE_M - np.abs(distance)) * columns / width + 0.5, 0.0, 1.0))
    return (lit[:, :, None] * _COLOUR).astype(np.uint8)
