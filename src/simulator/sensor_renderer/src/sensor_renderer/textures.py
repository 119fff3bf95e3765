# SPDX-License-Identifier: BSD-3-Clause
"""Pictures on surfaces, as textures of one context. ROS-free."""
from __future__ import annotations

from typing import TYPE_CHECKING

from PIL import Image

if TYPE_CHECKING:
    import moderngl

#: Pixels of all pictures together, at most: 256 MB of memory. When they are used up, further ones are reduced.
MAX_PIXELS = 48_000_000
# No picture is reduced below this side.
_MIN_SIDE = 64


class Textures:
    """Textures by the paths of their pictures, with smaller copies for distant surfaces."""

    def __init__(self, context: moderngl.Context) -> None:
        #: The context.
        self.context = context
        self._textures = {}
        self._left = MAX_PIXELS
        self._white = None

    def of(self, path: str) -> moderngl.Texture:
        """The texture of the picture at ``path``, as ``world_picture.textures.write_texture`` has made it; a white one
        for ""."""
        if not path:
            if self._white is None:
                self._white = self.context.texture((1, 1), 4, b"\xff" * 4)
            return self._white
        texture = self._textures.get(path)
        if texture is None:
            texture = self._textures[path] = self._read(path)
        return texture

    def clear(self) -> None:
        """Release all textures."""
        for texture in self._textures.values():
            texture.release()
        self._textures = {}
        self._left = MAX_PIXELS

    def _read(self, path):
        with Image.open(path) as picture:
            reduced = picture.convert("RGBA")
        side = max(reduced.size)
        while side > _MIN_SIDE and reduced.width * reduced.height > self._left:
            side //= 2
            reduced.thumbnail((side, side))
        self._left = max(self._left - reduced.width * reduced.height, 0)
        texture = self.context.texture(reduced.size, 4, reduced.tobytes())
        texture.filter = (self.context.LINEAR_MIPMAP_LINEAR, self.context.LINEAR)
        texture.build_mipmaps()
        return texture
