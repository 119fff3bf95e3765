# SPDX-License-Identifier: BSD-3-Clause
"""The floor: a sheet around the part of it to which shadows reach. ROS-free."""
from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from sensor_renderer.mirror import FLOOR_HALF_M
from sensor_renderer.programs import uniform

if TYPE_CHECKING:
    import moderngl

    from sensor_renderer.programs import Programs

# Light more slanted than this (sine of its angle to the floor) throws shadows over too much of it.
_MIN_SLANT = 0.15
# The corners of a rectangle counter-clockwise, as signs; two triangles of it; and the ring between two rectangles,
# of which the outer has the corners 4 to 7.
_SIGNS = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
_INNER = (0, 1, 2, 0, 2, 3)
_RING = tuple(corner for k in range(4) for corner in (k, 4 + k, 4 + (k + 1) % 4, k, 4 + (k + 1) % 4, (k + 1) % 4))


class Floor:
    """The floor of one context: in software, most of its pixels then need not look into the shadow map."""

    def __init__(self, context: moderngl.Context, programs: Programs) -> None:
        """``programs``: :class:`sensor_renderer.programs.Programs`."""
        self._context = context
        self._programs = programs
        self._rows = np.zeros((8, 10), dtype=np.float32)
        self._rows[:, 5] = 1.0
        self._buffer = context.buffer(self._rows.tobytes())
        self._inner_index, self._ring_index = (context.buffer(np.array(index, np.int32).tobytes())
                                               for index in (_INNER, _RING))
        self._arrays: tuple[moderngl.VertexArray, ...] = ()

    def build(self) -> None:
        """Make the vertex arrays for the programs as they are now."""
        layout = [(self._buffer, "3f 3f 4f", "position", "normal", "colour")]
        self._arrays = (self._context.vertex_array(self._programs.floor, layout, self._inner_index),
                        self._context.vertex_array(self._programs.bare_floor, layout, self._ring_index))

    def clear(self) -> None:
        """Release the vertex arrays."""
        for array in self._arrays:
            array.release()
        self._arrays = ()

    def draw(self, colour: Sequence[float], matrix: np.ndarray, packed: np.ndarray,
             corners: tuple[np.ndarray, np.ndarray]) -> None:
        """Draw it at ``matrix`` (4, 4), ``packed`` as OpenGL reads it, in ``colour``. ``corners``: as
        :meth:`sensor_renderer.shadows.Shadows.corners`."""
        outer = FLOOR_HALF_M * _SIGNS
        inner = on_floor(matrix, *corners)
        if inner is None or np.abs(inner).max() >= FLOOR_HALF_M:
            inner = outer
        self._rows[:4, :2], self._rows[4:, :2] = inner, outer
        self._rows[:, 6:9] = colour[:3]
        self._buffer.write(self._rows.tobytes())
        for array in self._arrays:
            uniform(array.program, "body").write(packed)
            array.render()


def on_floor(matrix: np.ndarray, corners: np.ndarray, away: np.ndarray) -> np.ndarray | None:
    """Where the floor at ``matrix`` (4, 4) meets the edges of the column from ``corners`` (4, 3) along ``away`` (3): x
    and y (4, 2) on the floor, counter-clockwise; None where the column hardly meets it."""
    upright = matrix[:3, 2]
    slant = float(away @ upright)
    if abs(slant) < _MIN_SLANT:
        return None
    along = (matrix[:3, 3] - corners) @ upright / slant
    met = (corners + along[:, None] * away - matrix[:3, 3]) @ matrix[:3, :2]
    return met if slant > 0.0 else met[::-1]
