# SPDX-License-Identifier: BSD-3-Clause
"""How many pixels a picture gets where drawing is slow: motion is worth more than sharpness. ROS-free."""
from __future__ import annotations

#: Sizes of a picture, as shares of the window's width and height.
SCALES = (1.0, 0.75, 0.5, 0.375, 0.25)
#: A picture at less than half of the window's width and height keeps so many pixels: only large windows get them.
MIN_PIXELS = 640 * 400
#: Pictures should take no longer than this [s]: with the pauses of the viewer, 20 come a second.
GOAL_S = 0.04
# So many pictures in a row decide.
_SLOW_ONES, _QUICK_ONES = 3, 15
# A larger size is tried where its pictures would take at most this share of the goal.
_ROOM = 0.8


class Sharpness:
    """``scale``: the share of the window's width and height to draw at."""

    def __init__(self) -> None:
        self.scale = SCALES[0]
        self._slow = self._quick = 0

    def take(self, spent_s: float, pixels: int) -> None:
        """A picture of the present size took ``spent_s`` [s, wall]; the window has so many ``pixels``."""
        allowed = [scale for scale in SCALES if scale >= 0.5 or scale ** 2 * pixels >= MIN_PIXELS]
        place = min(SCALES.index(self.scale), len(allowed) - 1)
        larger = allowed[max(place - 1, 0)]
        self._slow = self._slow + 1 if spent_s > GOAL_S else 0
        self._quick = self._quick + 1 if spent_s * (larger / self.scale) ** 2 < _ROOM * GOAL_S else 0
        if self._slow >= _SLOW_ONES:
            place = min(place + 1, len(allowed) - 1)
        elif self._quick >= _QUICK_ONES:
            place = max(place - 1, 0)
        if self.scale != allowed[place]:
            self.scale = allowed[place]
            self._slow = self._quick = 0
