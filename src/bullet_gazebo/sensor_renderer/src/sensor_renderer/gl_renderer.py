# SPDX-License-Identifier: BSD-3-Clause
"""Pictures with OpenGL on EGL: no display needed, a graphics card used where there is one. ROS-free.

Everything here belongs to the thread that made the renderer.
"""
import os

import numpy as np

from sensor_renderer.errors import RenderingError
from sensor_renderer.links import Links, visible
from sensor_renderer.programs import Programs, draw, matrix_bytes
from sensor_renderer.screens import Screens
from sensor_renderer.shadows import Shadows
from sensor_renderer.targets import Targets


class GlRenderer:
    """Draws a :class:`sensor_renderer.mirror.Mirror`."""

    def __init__(self):
        """Raises :class:`RenderingError` if EGL is not available."""
        # In software one thread: physics and the user's own programs need the other processors.
        os.environ.setdefault("LP_NUM_THREADS", "1")
        try:
            import moderngl

            self._context = moderngl.create_context(standalone=True, backend="egl", require=330)
        except Exception as error:  # noqa: BLE001  (each layer below raises its own kind)
            raise RenderingError("no OpenGL 3.3 on EGL: %s" % error) from error
        #: Name of the renderer, as the driver gives it.
        self.name = self._context.info["GL_RENDERER"]
        self._programs = Programs(self._context)
        self._shadows = Shadows(self._context, self._programs.shadow)
        self._links = Links(self._context, self._programs)
        self._screens = Screens(self._context, self._programs.screen)
        self._targets = Targets(self._context)
        self._lit_by = None
        self._context.enable(moderngl.DEPTH_TEST)

    def render(self, mirror, pinhole, pose, colour=True, depth=False):
        """Draw the view of a camera whose optical frame is at ``pose`` (4, 4) in the world.

        Returns (picture, depth): uint8 (height, width, 3) red, green, blue, and float32 (height, width) metres along
        the optical z axis, NaN where nothing is; None if not requested. The caller owns both arrays.
        """
        view = np.linalg.inv(pose)
        to_clip = pinhole.clip_matrix() @ view
        if mirror.light != self._lit_by:
            self._light_by(mirror.light)
        seen = [(self._links.arrays(link, matrix, pinhole, view), packed, link.is_floor)
                for link, matrix, packed in visible(self._links.everything(mirror), pinhole, view)]
        buffer, depth_texture = self._targets.of(pinhole.width, pinhole.height)
        picture = distance = None
        if colour:
            self._shadows.draw(mirror, lambda: [(link.arrays[1], packed) for link, _, packed
                                                in self._links.everything(mirror) if not link.is_floor])
            screens = self._screens.visible(mirror, pinhole, view)
            buffer.use()
            buffer.clear(*mirror.light.background, 1.0, depth=1.0)
            self._shadows.use(0)
            for program, floor in ((self._programs.surface, False), (self._programs.floor, True)):
                program["to_clip"].write(matrix_bytes(to_clip))
                program["eye"].value = tuple(pose[:3, 3])
                draw(program, [(arrays[0], packed) for arrays, packed, is_floor in seen if is_floor == floor])
            self._screens.draw(screens, to_clip)
            picture = np.frombuffer(buffer.read(components=3, alignment=1), np.uint8)
            picture = picture.reshape(pinhole.height, pinhole.width, 3)
        else:
            buffer.use()
            buffer.clear(depth=1.0)
            self._programs.shadow["to_clip"].write(matrix_bytes(to_clip))
            draw(self._programs.shadow, [(arrays[1], packed) for arrays, packed, _ in seen])
        if depth:
            raw = np.frombuffer(depth_texture.read(alignment=1), np.float32)
            distance = pinhole.depth_from_buffer(raw.reshape(pinhole.height, pinhole.width))
        return picture, distance

    def close(self):
        """Release the context."""
        self._context.release()

    def _light_by(self, light):
        if not self._programs.fit(light):
            self._links.clear()
            self._programs.compile(light)
        self._lit_by = light
        self._shadows.light_by(light)
        self._programs.light_by(light, self._shadows.to_map)
