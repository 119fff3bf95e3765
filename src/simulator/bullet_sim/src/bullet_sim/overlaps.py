# SPDX-License-Identifier: BSD-3-Clause
"""Free models that were put into other things come out of them without gaining speed.

Bullet turns the depth of an overlap into a speed. A Husky, which its launch file spawns with its wheels 0.13 m in the
ground, then flies 100 m high. Gazebo (ODE) corrects an overlap by the position alone.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from urdf_model import Surface
from urdf_model.model import ALL_BITS

from .builder import stiffness_of
from .quiet_pybullet import pybullet

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from .body import Body

# Shallower overlaps stay: bodies that rest on each other have them [m]. Soft surfaces, whose stiffness turns an overlap
# into a speed, keep no more than the one in which they bear the model's weight, and this at least.
_ALLOWED_M, _MIN_M = 1e-3, 1e-5
# Each moves a model out of what it is deepest in; in a corner the next one leads out of the other wall.
_ROUNDS = 10


def come_out(client: int, model: Body, index: int, others: Iterable[Body], gravity: Sequence[float]) -> None:
    """Move a free root of a Model, by its ``index``, out of the Models ``others``; its velocity is kept.

    It stays where it is if it cannot come out, between two walls for example. ``client``: PyBullet's; ``gravity`` (3,)
    [m/s^2].
    """
    weight = float(np.linalg.norm(gravity)) * sum(link.inertial.mass for link in model.merged.links.values())
    body = model.parts.places[index].body
    start, turn = pybullet.getBasePositionAndOrientation(body, physicsClientId=client)
    twist = pybullet.getBaseVelocity(body, physicsClientId=client)
    place = np.array(start)
    for _ in range(_ROUNDS):
        way = _deepest(client, model, body, others, weight)
        if way is None:
            break
        place = place + way
        _put(client, body, place.tolist(), turn, twist)
    else:
        _put(client, body, start, turn, twist)


def _put(client: int, body: int, place: Sequence[float], turn: Sequence[float], twist: tuple) -> None:
    pybullet.resetBasePositionAndOrientation(body, place, turn, physicsClientId=client)
    pybullet.resetBaseVelocity(body, *twist, physicsClientId=client)


def _deepest(client: int, model: Body, body: int, others: Iterable[Body], weight: float) -> np.ndarray | None:
    """Return the way (3,) [m, world] out of what the multibody ``body`` of ``model`` is deepest in, or None."""
    depth, way = 0.0, None
    for obstacle, owner in ((obstacle, other) for other in others for obstacle in other.parts.bodies):
        for point in pybullet.getClosestPoints(body, obstacle, -_MIN_M, physicsClientId=client) or ():
            surfaces = model.surface(body, point[3]), owner.surface(obstacle, point[4])
            if -point[8] > max(depth, _allowed(weight, surfaces)) and _bits(surfaces[0]) & _bits(surfaces[1]):
                # The normal points to the first body.
                depth = -point[8]
                way = depth * np.array(point[7])
    return way


def _allowed(weight: float, surfaces: Iterable[Surface]) -> float:
    """The depth [m] in which two surfaces may stay, of which one belongs to a model of this ``weight`` [N]."""
    softest = min(map(stiffness_of, surfaces))
    return min(max(weight / softest, _MIN_M), _ALLOWED_M) if 0.0 < softest < math.inf else _ALLOWED_M


def _bits(surface: Surface) -> int:
    return ALL_BITS if surface.bitmask is None else surface.bitmask
