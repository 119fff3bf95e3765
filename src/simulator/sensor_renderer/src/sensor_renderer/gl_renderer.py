# SPDX-License-Identifier: BSD-3-Clause
"""Pictures with OpenGL on EGL: no display needed, a graphics card used where there is one. ROS-free.

Everything here belongs to the thread that made the renderer.
"""
from __future__ import annotations

import math
import os
from typing import TYPE_CHECKING, Literal, NamedTuple, overload

import numpy as np

from sensor_renderer.drawn_links import Links, visible
from sensor_renderer.errors import RenderingError
from sensor_renderer.floor import Floor
from sensor_renderer.programs import Programs, draw, draw_textured, matrix_bytes, uniform
from sensor_renderer.screens import Screens
from sensor_renderer.shadows import Shadows
from sensor_renderer.sides import Sides
from sensor_renderer.targets import Framebuffers
from sensor_renderer.textures import Textures

if TYPE_CHECKING:
    from sensor_renderer.mirror import Mirror
    from sensor_renderer.pinhole import Pinhole

# The sky's colours are computed at the corners of so many cells along each side of a picture.
_SKY_CELLS = 12
# Names of Mesa's renderers without a graphics card.
_SOFTWARE = ("llvmpipe", "softpipe", "swrast", "software")


class Quality(NamedTuple):
    """``shadow_pixels``: the side of the sun's map; ``shadow_taps``: comparisons along one side of the square over
    which the edges of shadows are filtered."""

    shadow_pixels: int
    shadow_taps: int


#: Of cameras, and of single pictures.
LIVE, STILL = Quality(512, 1), Quality(2048, 5)


class GlRenderer:
    """Draws a :class:`sensor_renderer.mirror.Mirror`."""

    def __init__(self, still: bool = False) -> None:
        """``still``: for pictures that may take a second each, with smoother edges and finer shadows. Raises
        :class:`RenderingError` if EGL is not available."""
        # In software no threads but this one: physics and the user's own programs need the other processors, and
        # beside them each picture would wait for a second thread to be woken.
        os.environ.setdefault("LP_NUM_THREADS", "0")
        try:
            import moderngl

            self._context = moderngl.create_context(
                standalone=True, require=330,
                backend="egl")  # pyright: ignore[reportArgumentType]  (moderngl calls each setting a dict)
        except Exception as error:  # noqa: BLE001  (each layer below raises its own kind)
            raise RenderingError("no OpenGL 3.3 on EGL: %s" % error) from error
        #: Name of the renderer, as the driver gives it.
        self.name = self._context.info["GL_RENDERER"]
        software = any(name in self.name.lower() for name in _SOFTWARE)
        quality = STILL if still else LIVE
        # In software, half of the triangles of meshes are left out.
        self._one_sided = software and not still
        self._programs = Programs(self._context, quality.shadow_taps, still)
        self._shadows = Shadows(self._context, self._programs.shadow, quality.shadow_pixels, quality.shadow_taps,
                                self._one_sided)
        self._links = Links(self._context, self._programs, not still,
                            Sides(self._context) if self._one_sided else None)
        self._screens = Screens(self._context, self._programs.screen)
        self._textures = Textures(self._context)
        self._floor = Floor(self._context, self._programs)
        self._sky = self._context.vertex_array(
            self._programs.sky, [(self._context.buffer(_grid(_SKY_CELLS).tobytes()), "2f", "corner")])
        # In software, each sample of a pixel costs as much as a pixel.
        self._targets = Framebuffers(self._context, 1 if software and not still else min(4, self._context.max_samples))
        self._lit_by = None
        self._context.enable(moderngl.DEPTH_TEST)
        # A picture's rows go downwards.
        self._context.front_face = "cw"
        # The sky is at the largest depth.
        self._context.depth_func = "<="

    @overload
    def render(self, mirror: Mirror, pinhole: Pinhole, pose: np.ndarray, colour: Literal[True] = True,
               depth: bool = False) -> tuple[np.ndarray, np.ndarray | None]: ...

    @overload
    def render(self, mirror: Mirror, pinhole: Pinhole, pose: np.ndarray, colour: bool = True,
               depth: bool = False) -> tuple[np.ndarray | None, np.ndarray | None]: ...

    def render(self, mirror: Mirror, pinhole: Pinhole, pose: np.ndarray, colour: bool = True,
               depth: bool = False) -> tuple[np.ndarray | None, np.ndarray | None]:
        """Draw the view of a camera whose optical frame is at ``pose`` (4, 4) in the world.

        Returns (picture, depth): uint8 (height, width, 3) red, green, blue, and float32 (height, width) metres along
        the optical z axis, NaN where nothing is; None if not requested. The caller owns both arrays.
        """
        view = np.linalg.inv(pose)
        to_clip = pinhole.clip_matrix() @ view
        if mirror.light != self._lit_by:
            self._light_by(mirror.light)
        everything = self._links.everything(mirror)
        seen = [(self._links.arrays(link, distance, pinhole, depth), matrix, packed, link, distance)
                for link, matrix, packed, distance in visible(everything, pinhole, view)]
        target = self._targets.of(pinhole.width, pinhole.height)
        picture = distance = None
        if colour:
            casters = [entry for entry in everything if entry[0].caster is not None]
            if self._shadows.draw(mirror, casters, pinhole, pose):
                self._programs.shadow_by(self._shadows)
            screens = self._screens.visible(mirror, pinhole, view)
            target.clear(mirror.light.background)
            self._shadows.use()
            self._programs.look(to_clip, pose[:3, 3])
            textured = [(array, packed, material) for arrays, _, packed, _, _ in seen
                        for material, array in arrays.textured]
            self._draw(seen, [entry for entry in textured if entry[2].opacity >= 1.0], pinhole)
            self._screens.draw(screens, to_clip)
            if mirror.light.sky:
                uniform(self._programs.sky, "from_clip").write(matrix_bytes(_rays(pinhole, pose)))
                target.draw_behind(self._sky)
            # Far ones first.
            self._draw_textured([entry for entry in reversed(textured) if entry[2].opacity < 1.0])
            picture = target.picture()
        else:
            target.clear()
            uniform(self._programs.shadow, "to_clip").write(matrix_bytes(to_clip))
            draw(self._programs.shadow, [(arrays.depth, packed) for arrays, _, packed, _, _ in seen])
        if depth:
            distance = pinhole.depth_from_buffer(target.depth())
        return picture, distance

    def identify(self, mirror: Mirror, pinhole: Pinhole,
                 pose: np.ndarray) -> tuple[np.ndarray, list[tuple[str, int]], np.ndarray]:
        """The body at each pixel of the same view: (numbers, links, depth).

        ``numbers``: uint16 (height, width), 0 for nothing, else one more than the index in ``links``, a list of
        (model's name, number of the link in its ``parts``); ``depth`` as :meth:`render` returns it. A screen
        counts as what is behind it.
        """
        view = np.linalg.inv(pose)
        if mirror.light != self._lit_by:
            self._light_by(mirror.light)
        seen = [(self._links.arrays(link, distance, pinhole, True).depth, name, packed)
                for link, _, (name, packed), distance in visible(self._links.named(mirror), pinhole, view)]
        buffer, depth_texture = self._targets.numbered(pinhole.width, pinhole.height)
        buffer.use()
        buffer.clear(depth=1.0)
        program, links = self._programs.shadow, []
        uniform(program, "to_clip").write(matrix_bytes(pinhole.clip_matrix() @ view))
        for array, name, packed in seen:
            links.append(name)
            uniform(program, "number").value = len(links)
            draw(program, [(array, packed)])
        size = pinhole.height, pinhole.width
        numbers = np.frombuffer(buffer.read(components=1, dtype="u2", alignment=1), np.uint16).reshape(size)
        raw = np.frombuffer(depth_texture.read(alignment=1), np.float32).reshape(size)
        return numbers, links, pinhole.depth_from_buffer(raw)

    def prepare(self, mirror: Mirror) -> None:
        """Make all levels of detail of what ``mirror`` shows; what takes long is then on disk."""
        if mirror.light != self._lit_by:
            self._light_by(mirror.light)
        self._links.prepare(mirror)

    def close(self) -> None:
        """Release the context."""
        self._context.release()

    def _draw(self, seen, textured, pinhole):
        """Draw ``seen``, (:class:`sensor_renderer.drawn_links.Arrays`, matrix, packed matrix,
        :class:`sensor_renderer.drawn_links.DrawnLink`, distance of its sphere), ``textured`` as
        :func:`sensor_renderer.programs.draw_textured` takes them, and the floor last."""
        draw(self._programs.solid, [(arrays.colour, packed) for arrays, _, packed, link, _ in seen
                                    if not link.is_mesh and arrays.colour is not None])
        meshes = [(arrays, packed, distance) for arrays, _, packed, link, distance in seen
                  if link.is_mesh and arrays.colour is not None]
        # From within a link one may see any of its backs.
        within = pinhole.blind_m if self._one_sided else math.inf
        draw(self._programs.mesh, [(arrays.colour, packed, arrays.corners) for arrays, packed, distance in meshes
                                   if distance < within])
        if self._one_sided:
            self._context.enable(self._context.CULL_FACE)
            draw(self._programs.mesh, [(arrays.colour, packed) for arrays, packed, distance in meshes
                                       if distance >= within])
            self._context.disable(self._context.CULL_FACE)
        self._draw_textured(textured)
        for _, matrix, packed, link, _ in seen:
            if link.is_floor:
                self._floor.draw(link.parts[0].colour, matrix, packed, self._shadows.corners)

    def _draw_textured(self, listed):
        if listed:
            draw_textured(self._programs.textured(), listed, self._textures)

    def _light_by(self, light):
        if not self._programs.fit(light):
            self._links.clear()
            self._textures.clear()
            self._floor.clear()
            self._programs.compile(light)
            self._floor.build()
        self._lit_by = light
        self._shadows.light_by(light)
        self._programs.light_by(light)


def _rays(pinhole, pose):
    """The matrix (4, 4) from clip space at the largest depth to directions in the world."""
    turn = np.zeros((4, 4))
    wide, high = pinhole.width / 2.0, pinhole.height / 2.0
    turn[:3, :3] = pose[:3, :3] @ np.array([
        [wide / pinhole.fx, 0.0, (wide - 0.5 - pinhole.cx) / pinhole.fx],
        [0.0, high / pinhole.fy, (high - 0.5 - pinhole.cy) / pinhole.fy], [0.0, 0.0, 1.0]])
    return turn


def _grid(cells):
    """Two triangles (float32, corner by corner) for each of ``cells`` times ``cells`` squares from -1 to 1."""
    low = np.linspace(-1.0, 1.0, cells + 1)[:-1]
    corners = np.array([(0, 0), (1, 0), (0, 1), (1, 0), (1, 1), (0, 1)]) * (2.0 / cells)
    places = np.stack(np.meshgrid(low, low), axis=-1).reshape(-1, 1, 2)
    return (places + corners).astype(np.float32)
