# SPDX-License-Identifier: BSD-3-Clause
"""The head's screen: pictures of any usual encoding, put into its upper left corner."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from urdf_model import Box

from .errors import CommandRefused

if TYPE_CHECKING:
    from urdf_model import Robot

WIDTH, HEIGHT = 1024, 600
#: The link whose only shape is the glass, a thin box that looks along its z.
GLASS_LINK = "display"
# Distance of pictures in front of the glass, so that the glass does not hide them [m].
_BEFORE_M = 0.0005
# Channels of a pixel, and which of them are red, green and blue; cv_bridge's 8UC3 and 8UC1 do not define colours;
# clients use blue first.
ENCODINGS = {"rgb8": (3, (0, 1, 2)), "bgr8": (3, (2, 1, 0)), "8UC3": (3, (2, 1, 0)), "rgba8": (4, (0, 1, 2)),
             "bgra8": (4, (2, 1, 0)), "8UC4": (4, (2, 1, 0)), "mono8": (1, (0, 0, 0)), "8UC1": (1, (0, 0, 0))}


def on_glass(robot: Robot) -> tuple[np.ndarray, tuple[float, float]] | None:
    """The picture's place on GLASS_LINK of a urdf_model.Robot: (pose (4, 4), x to the right and y up for a viewer;
    width and height [m]), as wide as the glass. None for a robot without one."""
    shapes = robot.links[GLASS_LINK].visuals if GLASS_LINK in robot.links else []
    if len(shapes) != 1 or not isinstance(shapes[0].geometry, Box):
        return None
    width, _, thickness = shapes[0].geometry.size
    before = np.eye(4)
    before[2, 3] = thickness / 2.0 + _BEFORE_M
    return shapes[0].origin @ before, (width, width * HEIGHT / WIDTH)


class Screen:
    """`pixels`: (600, 1024, 3) uint8, red first: the present picture; `pictures`: number of pictures shown."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """A dark screen."""
        self.pixels = np.zeros((HEIGHT, WIDTH, 3), dtype=np.uint8)
        self.pictures = 0

    def show(self, width: int, height: int, encoding: str, step: int, data: bytes) -> None:
        """Show a picture, dark around it; `step`: bytes per row. Raises CommandRefused and keeps the last picture."""
        if encoding not in ENCODINGS:
            raise CommandRefused("picture has encoding '%s'; choices are %s" % (encoding, ", ".join(ENCODINGS)))
        channels, colours = ENCODINGS[encoding]
        if not (0 < width <= WIDTH and 0 < height <= HEIGHT):
            raise CommandRefused("picture has %d x %d pixels; the screen has %d x %d" % (width, height, WIDTH, HEIGHT))
        if step < width * channels or len(data) < step * height:
            raise CommandRefused("picture has %d bytes, %d a row; %d x %d pixels of %s need %d a row" % (
                len(data), step, width, height, encoding, width * channels))
        rows = np.frombuffer(data, dtype=np.uint8, count=step * height).reshape(height, step)
        picture = rows[:, :width * channels].reshape(height, width, channels)
        self.pixels = np.zeros_like(self.pixels)
        for k, channel in enumerate(colours):  # in one step it would take eight times as long, and the loop waits
            self.pixels[:height, :width, k] = picture[:, :, channel]
        self.pictures += 1
