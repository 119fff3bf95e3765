# SPDX-License-Identifier: BSD-3-Clause
"""The shadow map of the sun. ROS-free."""
import weakref

import numpy as np

from sensor_renderer.programs import draw, matrix_bytes

# Size of the shadow map around the robots' workspace [m], and pixels per side: 9 mm each.
_SHADOW_CENTRE = np.array([0.3, 0.0, 0.7])
_SHADOW_HALF_M = 2.2
_SHADOW_PIXELS = 512


class Shadows:
    """The map of one context. ``to_map`` (4, 4): from the world to texture coordinates 0 to 1 of the map."""

    def __init__(self, context, program):
        """``program``: the one that draws depth alone."""
        self._program = program
        self._map = context.depth_texture((_SHADOW_PIXELS, _SHADOW_PIXELS))
        self._map.compare_func = "<="
        # Between four comparisons: edges are soft.
        self._map.filter = (context.LINEAR, context.LINEAR)
        self._map.repeat_x = self._map.repeat_y = False
        self._buffer = context.framebuffer(depth_attachment=self._map)
        self._drawn = self._to_clip = self.to_map = None

    def light_by(self, light):
        """Point the map at the sun of ``light``."""
        self._drawn = None
        self._to_clip, self.to_map = _shadow_matrices(np.array(light.to_sun))

    def draw(self, mirror, listed):
        """Draw the map if ``mirror`` has changed. ``listed()``: (vertex array, packed matrix) of what casts shadows."""
        # Not by id(): a new object often gets the address of a deleted one.
        now = (weakref.ref(mirror), mirror.version)
        if self._drawn == now:
            return
        self._drawn = now
        self._buffer.use()
        self._buffer.clear(depth=1.0)
        if not mirror.light.shadows:
            return
        self._program["to_clip"].write(matrix_bytes(self._to_clip))
        draw(self._program, listed())

    def use(self, unit):
        """Bind the map to texture ``unit``."""
        self._map.use(unit)


def _shadow_matrices(away):
    """Matrices from the world to the clip space of the light from direction ``away``, and to texture coordinates 0 to 1
    of its map."""
    right = np.cross((0.0, 1.0, 0.0) if abs(away[1]) < 0.9 else (1.0, 0.0, 0.0), away)
    right /= np.linalg.norm(right)
    rotation = np.array([right, np.cross(away, right), away])
    to_clip = np.eye(4)
    to_clip[:3, :3] = rotation / _SHADOW_HALF_M
    to_clip[2] *= -1.0
    to_clip[:3, 3] = -to_clip[:3, :3] @ _SHADOW_CENTRE
    halved = np.diag([0.5, 0.5, 0.5, 1.0])
    halved[:3, 3] = 0.5
    return to_clip, halved @ to_clip
