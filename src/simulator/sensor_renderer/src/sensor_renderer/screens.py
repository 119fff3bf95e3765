# SPDX-License-Identifier: BSD-3-Clause
"""Rectangles that show pictures, such as the robot's face. ROS-free."""
from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from sensor_renderer.drawn_links import DrawnLink, visible
from sensor_renderer.programs import matrix_bytes, uniform

if TYPE_CHECKING:
    import moderngl

    from sensor_renderer.mirror import DrawnScreen, Mirror
    from sensor_renderer.pinhole import Pinhole

# A bent screen is drawn as so many flat stripes.
_STRIPES = 72


class Screens:
    """The textures of one context."""

    def __init__(self, context: moderngl.Context, program: moderngl.Program) -> None:
        """``program``: the one that draws a picture on a rectangle."""
        self._context = context
        self._program = program
        self._flat, self._bent = (self._stripes(count) for count in (1, _STRIPES))
        uniform(self._program, "picture").value = 1
        self._pictures = {}
        self._lit = set()  # those with a pixel that is not black

    def _stripes(self, count):
        edges = np.linspace(-0.5, 0.5, count + 1)
        corners = np.array([(x, y) for x in edges for y in (0.5, -0.5)], dtype=np.float32)
        return self._context.vertex_array(self._program, [(self._context.buffer(corners.tobytes()), "2f", "corner")])

    def draw(self, screens: Sequence[tuple[moderngl.Texture, np.ndarray, DrawnScreen]], to_clip: np.ndarray) -> None:
        """Draw ``screens``, as :meth:`visible` lists them."""
        if screens:
            uniform(self._program, "to_clip").write(matrix_bytes(to_clip))
        for texture, matrix, screen in screens:
            texture.use(1)
            uniform(self._program, "body").write(matrix_bytes(matrix))
            uniform(self._program, "shape").value = (*screen.size, 1.0 / screen.radius if screen.radius else 0.0)
            if screen.glows:
                self._context.enable(self._context.BLEND)
                self._context.blend_func = self._context.ONE, self._context.ONE_MINUS_SRC_ALPHA
            (self._bent if screen.radius else self._flat).render(self._context.TRIANGLE_STRIP)
            if screen.glows:
                self._context.disable(self._context.BLEND)

    def visible(self, mirror: Mirror, pinhole: Pinhole,
                view: np.ndarray) -> list[tuple[moderngl.Texture, np.ndarray, DrawnScreen]]:
        """The screens that show their faces, lights last: (texture, matrix of the screen's frame,
        :class:`sensor_renderer.mirror.DrawnScreen`)."""
        faces = []
        for body in mirror.bodies.values():
            for screen in body.screens:
                matrix = body.link_matrix(screen.link) @ screen.offset
                local = view @ matrix
                if screen.radius or local[:3, 2] @ local[:3, 3] < 0.0:
                    half = np.array([*screen.size, 0.0]) / 2.0 + screen.radius
                    faces.append((DrawnLink(np.zeros(3), half, float(np.linalg.norm(half)), False), matrix, screen))
        seen = [(self._texture(mirror, screen.picture), matrix, screen)
                for _, matrix, screen, _ in visible(faces, pinhole, view)]
        return sorted((entry for entry in seen if not entry[2].glows or entry[2].picture in self._lit),
                      key=lambda entry: entry[2].glows)

    def _texture(self, mirror, picture):
        texture = self._pictures.get(picture)
        if texture is None:
            there = {screen.picture for body in mirror.bodies.values() for screen in body.screens}
            for gone in self._pictures.keys() - there:
                self._pictures.pop(gone).release()
                self._lit.discard(gone)
            texture = self._pictures[picture] = self._context.texture((picture.width, picture.height), 3, alignment=1)
            texture.filter = (self._context.LINEAR_MIPMAP_LINEAR, self._context.LINEAR)
            texture.repeat_x = texture.repeat_y = False
        pixels = picture.read()
        if pixels is not None:
            texture.write(pixels.tobytes(), alignment=1)
            texture.build_mipmaps()
            (self._lit.add if pixels.any() else self._lit.discard)(picture)
        return texture
