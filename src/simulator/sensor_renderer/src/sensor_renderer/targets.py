# SPDX-License-Identifier: BSD-3-Clause
"""Framebuffers that pictures are drawn into. ROS-free."""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import moderngl


class Framebuffers:
    """The targets of one context, one for each size."""

    def __init__(self, context: moderngl.Context, samples: int) -> None:
        """``samples``: of each pixel, for smooth edges."""
        self._context = context
        self._samples = samples
        self._targets = {}
        self._numbered = {}

    def of(self, width: int, height: int) -> Framebuffer:
        """The :class:`Framebuffer` of this size [pixels]."""
        if (width, height) not in self._targets:
            self._targets[width, height] = Framebuffer(self._context, (width, height), self._samples)
        return self._targets[width, height]

    def numbered(self, width: int, height: int) -> tuple[moderngl.Framebuffer, moderngl.Texture]:
        """(framebuffer of one uint16 a pixel, its depth texture) of this size [pixels]."""
        if (width, height) not in self._numbered:
            depth = self._context.depth_texture((width, height))
            buffer = self._context.framebuffer(self._context.renderbuffer((width, height), 1, dtype="u2"), depth)
            self._numbered[width, height] = buffer, depth
        return self._numbered[width, height]


class Framebuffer:
    """A framebuffer: colour and depth."""

    def __init__(self, context: moderngl.Context, size: tuple[int, int], samples: int) -> None:
        """``size``: width, height [pixels]."""
        self._context = context
        self._size = size
        self._depth = context.depth_texture(size)
        self._read = self._drawn = context.framebuffer(context.renderbuffer(size, 4), self._depth)
        if samples > 1:
            self._drawn = context.framebuffer(context.renderbuffer(size, 4, samples=samples),
                                              context.depth_renderbuffer(size, samples=samples))

    def clear(self, colour: tuple[float, ...] = (0.0, 0.0, 0.0)) -> None:
        """Draw into this target from now on; it is empty."""
        self._drawn.use()
        red, green, blue = colour
        self._drawn.clear(red, green, blue, 1.0, depth=1.0)

    def draw_behind(self, array: moderngl.VertexArray) -> None:
        """Render ``array`` where nothing has been drawn; its depth is not kept."""
        self._drawn.depth_mask = False
        array.render()
        self._drawn.depth_mask = True

    def picture(self) -> np.ndarray:
        """uint8 (height, width, 3)."""
        self._resolve()
        pixels = np.frombuffer(self._read.read(components=3, alignment=1), np.uint8)
        return pixels.reshape(self._size[1], self._size[0], 3)

    def depth(self) -> np.ndarray:
        """float32 (height, width), 0 to 1."""
        self._resolve()
        return np.frombuffer(self._depth.read(alignment=1), np.float32).reshape(self._size[1], self._size[0])

    def _resolve(self):
        if self._drawn is not self._read:
            self._context.copy_framebuffer(self._read, self._drawn)
