# SPDX-License-Identifier: BSD-3-Clause
"""Domain randomisation (Tobin et al., 2017): each episode has things of other weight and friction, another light, and
cameras that sit a little differently. The robot's own lag and noise are `baxter_lab.Options`."""
from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from baxter_lab import Lab
from bullet_sim.quiet_pybullet import pybullet
from urdf_model.transforms import pose_matrix

#: Bullet multiplies both frictions of a contact; more than 1 would make it greater than either.
_MAX_FRICTION = 1.0
#: Of the curve between levels and light of a picture, IEC 61966-2-1.
_GAMMA = 2.4


class Randomised(NamedTuple):
    """How much differs, all 0 by default. mass, friction, light, colour: s multiplies what it is by 1 / (1 + s) to
    1 + s, of each thing, of the whole picture, of each colour of it; camera_m, camera_rad: shift and turn of a camera
    at most, about each axis [m], [rad]."""

    mass: float = 0.0
    friction: float = 0.0
    light: float = 0.0
    colour: float = 0.0
    camera_m: float = 0.0
    camera_rad: float = 0.0

    def require(self) -> None:
        """Raises ValueError for a number below 0, infinite, or NaN."""
        for name, value in self._asdict().items():
            if not (isinstance(value, (int, float, np.integer, np.floating)) and math.isfinite(value) and value >= 0.0):
                raise ValueError("randomised.%s is %r; it must be a number from 0" % (name, value))


class EpisodeDraw(NamedTuple):
    """Of one episode. masses, frictions: factors of the things in their order; light: (3,) factors of red, green and
    blue; cameras: (n, 4, 4), each a camera's pose in its usual frame."""

    masses: np.ndarray
    frictions: np.ndarray
    light: np.ndarray
    cameras: np.ndarray


class Randomiser:
    """Draws and applies for a lab with its things and cameras. Attribute `drawn`: of the present episode."""

    def __init__(self, much: Randomised, lab: Lab, cameras: Sequence[str]) -> None:
        much.require()
        self._much, self._lab, self._cameras = much, lab, tuple(cameras)
        things = [thing.model for name, thing in lab.things.items()]
        self._bodies = [[(model, body, None if model.static else model.inertial(body), link.surface)
                         for body, link in model.merged.links.items()] for model in things]
        count = len(things)
        self.drawn = EpisodeDraw(np.ones(count), np.ones(count), np.ones(3),
                                 np.tile(np.eye(4), (len(self._cameras), 1, 1)))

    def draw(self, random: np.random.Generator) -> None:
        """Another episode."""
        much, count = self._much, len(self._bodies)

        def factors(size, most):
            return np.exp(random.uniform(-1.0, 1.0, size) * math.log1p(most))

        masses, frictions = factors(count, much.mass), factors(count, much.friction)
        light = factors(3, much.colour) * factors(1, much.light)
        shifts, turns = random.uniform(-1.0, 1.0, (2, len(self._cameras), 3))
        cameras = [pose_matrix(much.camera_m * shift, much.camera_rad * turn)
                   for shift, turn in zip(shifts, turns, strict=True)]
        self.put(EpisodeDraw(masses, frictions, light, np.reshape(cameras, (-1, 4, 4))))

    def put(self, drawn: EpisodeDraw) -> None:
        """Make the things so."""
        for bodies, mass, friction in zip(self._bodies, drawn.masses, drawn.frictions, strict=True):
            for model, body, inertial, surface in bodies:
                if inertial is not None and self._much.mass:
                    model.set_inertial(body, mass * inertial.mass, mass * inertial.inertia)
                if self._much.friction:
                    usual = 1.0 if surface is None or surface.friction is None else surface.friction
                    pybullet.changeDynamics(*model.parts.places[model._link_index[body]],
                                            lateralFriction=min(friction * usual, max(usual, _MAX_FRICTION)),
                                            physicsClientId=self._lab.world._client)
        self.drawn = drawn

    def take(self, camera: str, size: int) -> np.ndarray:
        """(size, size, 3) uint8 by a camera, in this episode's light."""
        number = self._cameras.index(camera)
        pixels = self._lab.cameras.take(camera, size, size, moved=self.drawn.cameras[number]).pixels
        if not (self._much.light or self._much.colour):
            return pixels
        levels = np.linspace(0.0, 1.0, 256)[:, None] * self.drawn.light ** (1.0 / _GAMMA)
        curve = np.round(255.0 * np.clip(levels, 0.0, 1.0)).astype(np.uint8)
        return np.stack([curve[pixels[..., channel], channel] for channel in range(3)], axis=-1)
