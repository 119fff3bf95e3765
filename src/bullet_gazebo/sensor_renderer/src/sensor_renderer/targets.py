# SPDX-License-Identifier: BSD-3-Clause
"""What pictures are drawn into. ROS-free."""


class Targets:
    """The framebuffers of one context, one for each size."""

    def __init__(self, context):
        self._context = context
        self._buffers = {}

    def of(self, width, height):
        """(framebuffer, its depth texture) of this size [pixels]."""
        if (width, height) not in self._buffers:
            depth = self._context.depth_texture((width, height))
            buffer = self._context.framebuffer(self._context.renderbuffer((width, height), 4), depth)
            self._buffers[width, height] = buffer, depth
        return self._buffers[width, height]
