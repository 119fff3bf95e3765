# SPDX-License-Identifier: BSD-3-Clause
"""Pictures of a topic on a visual."""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from sensor_msgs.msg import Image

from gazebo_ros.model_plugin import ModelPlugin, PluginError
from gazebo_ros.urdf_extras import visual_of
from urdf_model import Box, Cylinder, Mesh, Sphere

if TYPE_CHECKING:
    from gazebo_ros.model_plugin import PluginContext
    from urdf_model import Shape

# Gazebo's visuals are scaled from a size of 1, and the picture is above the middle by this part of their height.
_ABOVE = 0.51
# Channels of a pixel, and which of them are red, green and blue.
_ENCODINGS = {"rgb8": (3, (0, 1, 2)), "bgr8": (3, (2, 1, 0)), "8UC3": (3, (2, 1, 0)), "rgba8": (4, (0, 1, 2)),
              "bgra8": (4, (2, 1, 0)), "8UC4": (4, (2, 1, 0)), "mono8": (1, (0, 0, 0)), "8UC1": (1, (0, 0, 0))}
_MAX_PIXELS = 4096


class Video(ModelPlugin):
    """``libgazebo_ros_video.so`` in a ``<visual>``: shows the pictures of ``topicName`` (image_raw), scaled to
    ``width`` (320) times ``height`` (240) pixels, on a rectangle above the visual, seen from its +z."""

    required = False

    def __init__(self, context: PluginContext) -> None:
        super().__init__(context)
        self._what = "plugin %s of model '%s'" % (context.element.get("filename"), context.model.name)
        self._pixels = self._count("width", 320), self._count("height", 240)
        link, name = visual_of(context.element)
        if link is None:
            raise PluginError("%s stands outside of a <visual>; expected <gazebo reference=\"LINK\"><visual><plugin>"
                              % self._what)
        shapes = [shape for shape in context.robot.links[link].visuals if name in (None, shape.name)]
        if not shapes:
            raise PluginError("%s: its link '%s' has no visual to show pictures on" % (self._what, link))
        self._screens = []
        for shape in shapes:
            x, y, z = _scale(shape)
            place = np.eye(4)
            place[2, 3] = _ABOVE * z
            self._screens.append(context.screen(link, shape.origin @ place, (x, y), self._pixels))
        self._pictures = context.subscription(context.element_text("topicName", "image_raw"), Image)

    def _count(self, tag: str, default: int) -> int:
        text = self.context.element_text(tag, str(default))
        try:
            value = int(text)
        except ValueError:
            value = 0
        if not 0 < value <= _MAX_PIXELS:
            raise PluginError("%s: <%s> is '%s', expected a number of pixels from 1 to %d"
                              % (self._what, tag, text, _MAX_PIXELS))
        return value

    def update(self, time_s: float, dt: float) -> None:
        message = self._pictures.take()
        if message is not None:
            self._pictures.guarded(self._show, message)

    def _show(self, message: Image) -> None:
        channels, colours = _ENCODINGS.get(message.encoding, (0, ()))
        width, height, row = message.width, message.height, message.step
        if not channels:
            why = "encoding '%s'; choices are %s" % (message.encoding, ", ".join(_ENCODINGS))
        elif not (width and height) or row < width * channels or len(message.data) < row * height:
            why = "%d bytes, %d a row, for %d x %d pixels of %s" % (len(message.data), row, width, height,
                                                                   message.encoding)
        else:
            rows = np.frombuffer(message.data, np.uint8, row * height).reshape(height, row)
            # The nearest pixel for each of the screen, before anything is copied: the loop waits.
            lines = np.arange(self._pixels[1]) * height // self._pixels[1]
            columns = np.arange(self._pixels[0]) * width // self._pixels[0] * channels
            picture = np.stack([rows[lines[:, None], columns + colour] for colour in colours], axis=-1)
            for screen in self._screens:
                screen.show(picture)
            return
        self.context.log.warn_throttle(5.0, "%s: a picture is not shown: it has %s" % (self._what, why))


def _scale(shape: Shape) -> tuple[float, float, float]:
    """The size of a visual [m], or the scale of a mesh."""
    found = shape.geometry
    if isinstance(found, Box):
        return found.size[0], found.size[1], found.size[2]
    if isinstance(found, Cylinder):
        return 2.0 * found.radius, 2.0 * found.radius, found.length
    if isinstance(found, Sphere):
        return 2.0 * found.radius, 2.0 * found.radius, 2.0 * found.radius
    if isinstance(found, Mesh):
        return abs(found.scale[0]), abs(found.scale[1]), abs(found.scale[2])
    return found.size[0], found.size[1], 1.0  # a plane
