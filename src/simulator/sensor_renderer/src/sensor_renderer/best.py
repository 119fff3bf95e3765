# SPDX-License-Identifier: BSD-3-Clause
"""The best renderer of this machine. ROS-free."""
from __future__ import annotations

from typing import TYPE_CHECKING

from sensor_renderer.errors import RenderingError
from sensor_renderer.gl_renderer import GlRenderer

if TYPE_CHECKING:
    from sensor_renderer.tiny_renderer import TinyRenderer


def best_renderer(still: bool = False) -> tuple[GlRenderer | TinyRenderer, str]:
    """(renderer, problem): a :class:`GlRenderer` and "", or, where there is no EGL, a
    :class:`sensor_renderer.tiny_renderer.TinyRenderer` and a line that says why. It belongs to the calling thread.
    ``still``: as of :class:`GlRenderer`, for single pictures."""
    try:
        return GlRenderer(still=still), ""
    except RenderingError as error:
        from sensor_renderer.tiny_renderer import TinyRenderer

        return TinyRenderer(), ("%s; pictures come from PyBullet's TinyRenderer, about ten times slower. Install "
                                "libegl1 and libgl1-mesa-dri." % error)
