# SPDX-License-Identifier: BSD-3-Clause
"""A screen of a model in PyBullet's window. ROS-free."""
import os
import struct
import tempfile

import numpy as np

from bullet_sim.quiet_pybullet import pybullet
from world_picture.shared_picture import PictureReader

# PyBullet reads a texture as a Python list: more columns than this would take longer than a frame of the window.
_MOST_COLUMNS = 256
# PyBullet loads a texture from a file first; Targa has the simplest header.
_TARGA = struct.Struct("<2xB9xHHBx")
_TRUE_COLOUR, _BITS = 2, 24


class WindowScreen:
    """A rectangle with a picture. ``link``: the link it hangs on; ``shape``: number of its visual shape."""

    def __init__(self, listed, client):
        """``listed``: a screen of the scene. Raises ``SnapshotError`` when its picture is gone."""
        self.link = listed["link"]
        self._client = client
        self._picture = PictureReader(listed["picture"])
        self._step = -(-self._picture.width // _MOST_COLUMNS)
        self._size = self._picture.width // self._step, self._picture.height // self._step
        offset = np.reshape(listed["offset"], (4, 4))
        half = np.array(listed["size"]) / 2.0
        corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
        vertices = np.hstack([corners * half, np.zeros((4, 1))]) @ offset[:3, :3].T + offset[:3, 3]
        self.shape = pybullet.createVisualShape(
            pybullet.GEOM_MESH, vertices=vertices.tolist(), indices=[0, 1, 2, 0, 2, 3],
            uvs=((corners + 1) / 2).tolist(), normals=[offset[:3, 2].tolist()] * 4, rgbaColor=[1.0, 1.0, 1.0, 1.0],
            physicsClientId=client)
        self._texture = self._black_texture()

    def put_on(self, body, link):
        """Show the picture on a link of a body that was made with :attr:`shape`; both by their numbers."""
        pybullet.changeVisualShape(body, link, textureUniqueId=self._texture, specularColor=[0.0, 0.0, 0.0],
                                   physicsClientId=self._client)
        self.refresh()

    def refresh(self):
        """Show the picture as it is now."""
        pixels = self._picture.read()
        if pixels is None:
            return
        (columns, rows), step = self._size, self._step
        whole = pixels[:rows * step, :columns * step].reshape(rows, step, columns, step, 3)
        small = whole.mean(axis=(1, 3)).astype(np.uint8)
        pybullet.changeTexture(self._texture, small.ravel().tolist(), columns, rows, physicsClientId=self._client)

    def _black_texture(self):
        columns, rows = self._size
        with tempfile.NamedTemporaryFile(suffix=".tga", delete=False) as file:
            file.write(_TARGA.pack(_TRUE_COLOUR, columns, rows, _BITS) + bytes(3 * columns * rows))
        try:
            return pybullet.loadTexture(file.name, physicsClientId=self._client)
        finally:
            os.unlink(file.name)
