# SPDX-License-Identifier: BSD-3-Clause
"""Which triangles of a link show their backs. ROS-free.

Without a graphics card, each triangle that need not be drawn counts. A closed surface shows no backs, but the shells of
a robot are open where they meet others. So a link is looked at from all around, once, and its triangles that show
their backs are drawn from both sides, all others from the front alone.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from sensor_renderer.programs import matrix_bytes, uniform

if TYPE_CHECKING:
    import moderngl

# A link is looked at from so many directions, spread evenly, in pictures of this side [pixels].
_DIRECTIONS, _PIXELS = 36, 192
_COLUMNS = 6
# Spheres that just touch a picture's edge are a little smaller than it.
_ROOM = 1.01
# A shadow may miss triangles whose backs have no more than so many pixels in all of these pictures together.
_MAX_MISSED = 10

_VERTEX = """
#version 330
uniform mat4 to_clip;
in vec3 position;
void main() { gl_Position = to_clip * vec4(position, 1.0); }
"""

_FRAGMENT = """
#version 330
out uint seen;
void main() { seen = 2u * uint(gl_PrimitiveID) + (gl_FrontFacing ? 1u : 2u); }
"""


class Sides:
    """Looks at the links of one context."""

    def __init__(self, context: moderngl.Context) -> None:
        """``context``: of moderngl, which compares depths, culls nothing and takes clockwise corners for fronts."""
        self._context = context
        self._program = context.program(vertex_shader=_VERTEX, fragment_shader=_FRAGMENT)
        size = _COLUMNS * _PIXELS, -(-_DIRECTIONS // _COLUMNS) * _PIXELS
        self._buffer = context.framebuffer(context.renderbuffer(size, 1, dtype="u4"), context.depth_renderbuffer(size))
        self._size = size

    def from_behind(self, points: np.ndarray, centre: np.ndarray, radius: float) -> np.ndarray:
        """Return which of the triangles with the corners ``points`` (3 m, 3) must be drawn from behind, too: bool (m,).
        ``centre`` (3,), ``radius``: of a sphere around them.

        Afterwards another framebuffer is in use. A triangle too small to be seen, or behind others, is taken for
        one of those that it touches, as is one between them.
        """
        front, back = self._pixels(points, centre, radius) > 0
        _, corners = indexed(points)
        corners = corners.reshape(-1, 3)
        touched = np.zeros(len(points), dtype=bool)
        touched[corners[back].ravel()] = True
        touching = touched[corners].sum(axis=1)
        return back | (touching >= np.where(front, 2, 1))

    def plainly_from_behind(self, points: np.ndarray, centre: np.ndarray, radius: float) -> np.ndarray:
        """The same for what casts shadows: those whose backs are plainly seen, bool (m,).

        Of a mesh with few triangles nearly all touch one that shows its back; to draw them all twice costs more than
        to leave nothing out. Shadows differ by three pixels in a picture of 640 x 400.
        """
        return self._pixels(points, centre, radius)[1] > _MAX_MISSED

    def _pixels(self, points, centre, radius):
        """The number of pixels of each triangle's front and back in all pictures: int (2, m)."""
        points = np.ascontiguousarray(points, dtype=np.float32)
        array = self._context.vertex_array(self._program,
                                           [(self._context.buffer(points.tobytes()), "3f", "position")])
        self._buffer.use()
        self._buffer.viewport = 0, 0, *self._size
        self._buffer.clear(depth=1.0)
        for number, away in enumerate(_directions()):
            self._buffer.viewport = (number % _COLUMNS) * _PIXELS, (number // _COLUMNS) * _PIXELS, _PIXELS, _PIXELS
            uniform(self._program, "to_clip").write(matrix_bytes(_looking(away, centre, radius * _ROOM)))
            array.render()
        numbers = np.frombuffer(self._buffer.read(components=1, dtype="u4", alignment=1), np.uint32)
        array.release()
        return np.bincount(numbers, minlength=2 * (len(points) // 3) + 1)[1:].reshape(-1, 2).T


def indexed(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the different ones of float32 ``rows`` (n, k) in the order of their first use, and the number of each row
    among them (n,). Neighbours have near numbers, which the vertices' cache needs."""
    rows = np.ascontiguousarray(rows + np.float32(0.0))
    whole = rows.view(np.dtype((np.void, rows.itemsize * rows.shape[1]))).ravel()
    _, first, index = np.unique(whole, return_index=True, return_inverse=True)
    order = np.argsort(first)
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    return rows[first[order]], place[index.ravel()]


def _directions():
    """Unit vectors (n, 3) along a spiral from pole to pole, each with the same share of the sphere."""
    turns = np.arange(_DIRECTIONS) + 0.5
    height = 1.0 - 2.0 * turns / _DIRECTIONS
    angle, wide = math.pi * (1.0 + math.sqrt(5.0)) * turns, np.sqrt(1.0 - height ** 2)
    return np.stack([wide * np.cos(angle), wide * np.sin(angle), height], axis=1)


def _looking(away, centre, radius):
    """To clip space (4, 4), for a viewer far off in the direction ``away`` (3,)."""
    right = np.cross(away, np.eye(3)[np.argmin(np.abs(away))])
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    # Downwards, as all pictures.
    matrix[:3, :3] = np.array([right, -np.cross(away, right), -away]) / radius
    matrix[:3, 3] = -matrix[:3, :3] @ centre
    return matrix
