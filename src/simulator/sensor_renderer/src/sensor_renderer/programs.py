# SPDX-License-Identifier: BSD-3-Clause
"""The programs of the shaders in ``shaders``, and their uniforms. ROS-free."""
from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, cast

import numpy as np

from sensor_renderer import shaders

if TYPE_CHECKING:
    import moderngl

    from sensor_renderer.drawn_links import VertexArray
    from sensor_renderer.light import SceneLight
    from sensor_renderer.mirror import PartLook
    from sensor_renderer.shadows import Shadows
    from sensor_renderer.textures import Textures

    #: Whether the sun casts shadows, whether there is a sky, and the kind of each lamp.
    _Kinds = tuple[bool, bool, tuple[tuple[str, bool], ...]]

# What is seen of a mesh and what casts its shadow differ by up to about this much [m].
_THINNED_M = 0.015


class Programs:
    """The programs of one context. ``mesh`` computes light per vertex, ``solid`` per pixel; ``floor`` draws the floor,
    ``bare_floor`` the parts of it to which no shadow of the sun reaches; ``shadow`` draws depth alone, or with it a
    number for each link; ``screen`` a picture on a rectangle, ``sky`` the background. :meth:`textured` draws what has a
    picture or light of its own, per pixel."""

    def __init__(self, context: moderngl.Context, shadow_taps: int, per_pixel: bool) -> None:
        """Compiles those that do not depend on the light. ``shadow_taps``: comparisons along one side of the square
        over which the edges of shadows are filtered; ``per_pixel``: whether ``mesh`` computes light per pixel too."""
        self._context = context
        self._taps, self._per_pixel = shadow_taps, per_pixel
        self.screen = context.program(vertex_shader=shaders.SCREEN_VERTEX, fragment_shader=shaders.SCREEN_FRAGMENT)
        self.shadow = context.program(vertex_shader=shaders.SHADOW_VERTEX, fragment_shader=shaders.SHADOW_FRAGMENT)
        self.sky = context.program(vertex_shader=shaders.SKY_VERTEX, fragment_shader=shaders.SKY_FRAGMENT)
        # Made by compile().
        self.mesh: moderngl.Program
        self.solid: moderngl.Program
        self.floor: moderngl.Program
        self.bare_floor: moderngl.Program
        self._lit: tuple[moderngl.Program, ...] = ()
        self._textured: moderngl.Program | None = None
        self._kinds: _Kinds | None = None
        self._light: SceneLight
        self._shadows: Shadows | None = None

    def fit(self, light: SceneLight) -> bool:
        """Whether the programs are the ones for ``light`` already."""
        return self._kinds == _kinds(light)

    def compile(self, light: SceneLight) -> None:
        """Make the programs for ``light``; vertex arrays of the old ones must have been released."""
        for old in self._lit:
            old.release()
        self._textured = None
        self._kinds = shadow, sky, lamps = _kinds(light)
        meshes = shaders.placed_shaders if self._per_pixel else shaders.lit_shaders
        self.mesh = self._program(meshes(shadow, lamps, self._taps if self._per_pixel else 1))
        self.solid = self._program(shaders.placed_shaders(shadow, lamps, self._taps))
        self.floor = self._program(shaders.floor_shaders(shadow, lamps, self._taps, sky))
        self.bare_floor = self._program(shaders.floor_shaders(False, lamps, self._taps, sky))
        self._lit = self.mesh, self.solid, self.floor, self.bare_floor

    def textured(self) -> moderngl.Program:
        """The program for what has a picture or light of its own. It is made when it is first needed: most worlds do
        without it, and each program costs time in each picture."""
        if self._textured is None:
            shadow, _, lamps = _kinds(self._light)
            self._textured = self._program(shaders.textured_shaders(shadow, lamps, self._taps))
            self._lit = *self._lit, self._textured
            self._light_by(self._light, self._textured)
            if self._shadows is not None:
                self._shadow_by(self._shadows, self._textured)
        return self._textured

    def light_by(self, light: SceneLight) -> None:
        """Set the uniforms of ``light``."""
        self._light = light
        for program in self._lit:
            self._light_by(light, program)
        for name in ("horizon", "zenith", "sun", "to_sun"):
            set_uniform(self.sky, name, getattr(light, name))

    def _light_by(self, light, program):
        for name in ("ambient", "sun", "sun_shine", "to_sun", "horizon"):
            set_uniform(program, name, getattr(light, name))
        for unit, name in enumerate(("shadow", "picture", "lamp_shadow")):
            set_uniform(program, name, unit)
        for number, lamp in enumerate(light.lamps):
            for name, value in lamp.uniforms().items():
                set_uniform(program, "%s_%d" % (name, number), value)

    def look(self, to_clip: np.ndarray, eye: np.ndarray) -> None:
        """Set the camera: from the world to clip space (4, 4), its place (3)."""
        for program in self._lit:
            uniform(program, "to_clip").write(matrix_bytes(to_clip))
            set_uniform(program, "eye", tuple(eye))

    def shadow_by(self, shadows: Shadows) -> None:
        """Set where the maps of :class:`sensor_renderer.shadows.Shadows` are."""
        self._shadows = shadows
        for program in self._lit:
            self._shadow_by(shadows, program)

    def _shadow_by(self, shadows, program):
        if "to_shadow" in program:
            uniform(program, "to_shadow").write(matrix_bytes(shadows.to_map))
        for number, matrix in shadows.lamp_matrices.items():
            if "lamp_matrix_%d" % number in program:
                uniform(program, "lamp_matrix_%d" % number).write(matrix_bytes(matrix))
        of_meshes = program in (self.mesh, self._textured)
        set_uniform(program, "margin", shadows.margin_m + (_THINNED_M if of_meshes else 0.0))

    def _program(self, vertex_and_fragment):
        vertex, fragment = vertex_and_fragment
        return self._context.program(vertex_shader=vertex, fragment_shader=fragment)


def uniform(program: moderngl.Program, name: str) -> moderngl.Uniform:
    """The uniform ``name`` of ``program``."""
    return cast("moderngl.Uniform", program[name])


def set_uniform(program: moderngl.Program, name: str, value: float | tuple[float, ...]) -> None:
    """Set the uniform ``name`` of ``program``, if it has it."""
    # The compiler leaves out what a program does not use.
    if name in program:
        uniform(program, name).value = value


def _kinds(light: SceneLight) -> _Kinds:
    """The parts of the light that the programs depend on."""
    return light.shadows and any(light.sun), light.sky, tuple(lamp.kind for lamp in light.lamps)


def matrix_bytes(matrix: np.ndarray) -> bytes:
    """A (4, 4) matrix column by column, as OpenGL reads it."""
    return np.asarray(matrix, dtype=np.float32).T.tobytes()


def draw(program: moderngl.Program,
         listed: Iterable[tuple[VertexArray, np.ndarray] | tuple[VertexArray, np.ndarray, int]]) -> None:
    """Render ``listed``, (vertex array, matrix of the body as OpenGL reads it, how many corners if not all)."""
    body = uniform(program, "body")
    for array, packed, *corners in listed:
        body.write(packed)
        array.render(vertices=corners[0] if corners else -1)


def draw_textured(program: moderngl.Program, listed: Sequence[tuple[VertexArray, np.ndarray, PartLook]],
                  textures: Textures) -> None:
    """Render ``listed``, (vertex array, matrix of the body as OpenGL reads it, its
    :class:`sensor_renderer.mirror.PartLook`), whose materials are all opaque or all transparent; the latter are drawn
    over what is behind them, in their order. ``textures``: :class:`sensor_renderer.textures.Textures`.

    As in Gazebo, pictures are seen from the front: signs have one sheet for each side, in the same place.
    """
    body, context = uniform(program, "body"), textures.context
    if listed[0][2].opacity < 1.0:
        context.enable(context.BLEND)
        context.blend_func = context.SRC_ALPHA, context.ONE_MINUS_SRC_ALPHA
    else:
        listed = sorted(listed, key=lambda entry: entry[2].two_sided)
    for array, packed, material in listed:
        (context.disable if material.two_sided else context.enable)(context.CULL_FACE)
        textures.of(material.texture).use(1)
        uniform(program, "emission").value = material.emission
        uniform(program, "least").value = 0.5 if material.cut_out else 0.0
        uniform(program, "opacity").value = material.opacity
        body.write(packed)
        array.render()
    context.disable(context.CULL_FACE | context.BLEND)
