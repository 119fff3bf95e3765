# SPDX-License-Identifier: BSD-3-Clause
"""Pictures with PyBullet's TinyRenderer, for machines without EGL: correct, and about ten times slower. ROS-free."""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pybullet

from sensor_renderer.errors import RenderingError
from urdf_model.transforms import quaternion_from_matrix

if TYPE_CHECKING:
    from sensor_renderer.mirror import Mirror
    from sensor_renderer.pinhole import Pinhole

_SPECULAR = 0.05


class TinyRenderer:
    """The same calls as :class:`sensor_renderer.gl_renderer.GlRenderer`."""

    name = "PyBullet's TinyRenderer"

    def __init__(self) -> None:
        """Raises :class:`RenderingError` when PyBullet gives no client."""
        self._client = pybullet.connect(pybullet.DIRECT)
        if self._client < 0:
            raise RenderingError("PyBullet gave no client to draw with")
        self._shapes = {}
        self._bodies = {}

    def render(self, mirror: Mirror, pinhole: Pinhole, pose: np.ndarray, colour: bool = True,
               depth: bool = False) -> tuple[np.ndarray | None, np.ndarray | None]:
        """As :meth:`GlRenderer.render`."""
        rgba, values, _ = self._image(mirror, pinhole, pose, pybullet.ER_NO_SEGMENTATION_MASK)
        size = pinhole.height, pinhole.width
        picture = np.array(rgba, dtype=np.uint8).reshape(*size, 4)[:, :, :3] if colour else None
        distance = None
        if depth:
            distance = pinhole.depth_from_buffer(np.array(values, dtype=np.float32).reshape(size))
        return picture, distance

    def identify(self, mirror: Mirror, pinhole: Pinhole,
                 pose: np.ndarray) -> tuple[np.ndarray, list[tuple[str, int]], np.ndarray]:
        """As :meth:`GlRenderer.identify`."""
        _, values, mask = self._image(mirror, pinhole, pose, 0)
        size = pinhole.height, pinhole.width
        links = list(dict.fromkeys(key[:2] for key in self._bodies))
        number = {body: 1 + links.index(key[:2]) for key, (_, body) in self._bodies.items()}
        table = np.zeros(2 + max(number, default=0), dtype=np.uint16)
        table[[body + 1 for body in number]] = list(number.values())
        numbers = table[np.array(mask).reshape(size) + 1]  # nothing is -1
        return numbers, links, pinhole.depth_from_buffer(np.array(values, dtype=np.float32).reshape(size))

    def _image(self, mirror, pinhole, pose, flags):
        """(colours, depth buffer, mask) of the view, as PyBullet has them."""
        self._follow(mirror)
        light = mirror.light
        clip = pinhole.clip_matrix()
        clip[1] *= -1.0  # PyBullet turns the picture over by itself
        # OpenGL's eye looks along -z with y up.
        turn = np.diag([1.0, -1.0, -1.0, 1.0])
        return pybullet.getCameraImage(
            pinhole.width, pinhole.height, (turn @ np.linalg.inv(pose)).T.ravel().tolist(),
            (clip @ turn).T.ravel().tolist(), lightDirection=list(light.to_sun), shadow=0,
            lightAmbientCoeff=1.1 * float(np.mean(light.ambient)), lightDiffuseCoeff=float(np.mean(light.sun)),
            lightSpecularCoeff=_SPECULAR, flags=flags,
            renderer=pybullet.ER_TINY_RENDERER, physicsClientId=self._client)[2:]

    def close(self) -> None:
        """Disconnect the client."""
        pybullet.disconnect(physicsClientId=self._client)

    def _follow(self, mirror):
        wanted = {}
        for name, body in mirror.bodies.items():
            for link, parts in enumerate(body.parts):
                for number, part in enumerate(parts):
                    wanted[name, link, number] = part, body.matrices[link]
        for key in [key for key, (part, _) in self._bodies.items() if key not in wanted or wanted[key][0] is not part]:
            pybullet.removeBody(self._bodies.pop(key)[1], physicsClientId=self._client)
        for key, (part, matrix) in wanted.items():
            if key not in self._bodies:
                self._bodies[key] = part, self._make(part)
            pybullet.resetBasePositionAndOrientation(
                self._bodies[key][1], matrix[:3, 3].tolist(), quaternion_from_matrix(matrix).tolist(),
                physicsClientId=self._client)

    def _make(self, part):
        key = part.key, part.colour
        if key not in self._shapes:
            rows = part.triangles
            self._shapes[key] = pybullet.createVisualShape(
                pybullet.GEOM_MESH, vertices=rows[:, :3].tolist(), normals=rows[:, 3:].tolist(),
                indices=list(range(len(rows))), rgbaColor=list(part.colour), physicsClientId=self._client)
        return pybullet.createMultiBody(baseVisualShapeIndex=self._shapes[key], physicsClientId=self._client)
