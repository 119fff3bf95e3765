# SPDX-License-Identifier: BSD-3-Clause
"""Free models that were put into other things come out of them without gaining speed.

Bullet turns the depth of an overlap into a speed. A Husky, which its launch file spawns with its wheels 0.13 m in the
ground, then flies 100 m high. Gazebo (ODE) corrects an overlap by the position alone.
"""
import numpy as np

from urdf_model.model import ALL_BITS

from .quiet_pybullet import pybullet

# Shallower overlaps stay: bodies that rest on each other have them [m].
_ALLOWED_M = 1e-3
# Each moves a model out of what it is deepest in; in a corner the next one leads out of the other wall.
_ROUNDS = 10


def come_out(client, model, index, others):
    """Move a free root of a Model, by its ``index``, out of the Models ``others``; its velocity is kept.

    It stays where it is if it cannot come out, between two walls for example. ``client``: PyBullet's.
    """
    body = model.parts.places[index].body
    start, turn = pybullet.getBasePositionAndOrientation(body, physicsClientId=client)
    twist = pybullet.getBaseVelocity(body, physicsClientId=client)
    place = np.array(start)
    for _ in range(_ROUNDS):
        way = _deepest(client, model, body, others)
        if way is None:
            break
        place = place + way
        _put(client, body, place.tolist(), turn, twist)
    else:
        _put(client, body, start, turn, twist)


def _put(client, body, place, turn, twist):
    pybullet.resetBasePositionAndOrientation(body, place, turn, physicsClientId=client)
    pybullet.resetBaseVelocity(body, *twist, physicsClientId=client)


def _deepest(client, model, body, others):
    """Return the way (3,) [m, world] out of what the multibody ``body`` of ``model`` is deepest in, or None."""
    depth, way = _ALLOWED_M, None
    for obstacle, owner in ((obstacle, other) for other in others for obstacle in other.parts.bodies):
        for point in pybullet.getClosestPoints(body, obstacle, 0.0, physicsClientId=client) or ():
            if -point[8] > depth and _bits(model, body, point[3]) & _bits(owner, obstacle, point[4]):
                # The normal points to the first body.
                depth = -point[8]
                way = depth * np.array(point[7])
    return way


def _bits(model, body, index):
    """The ``Surface.bitmask`` of the link that PyBullet numbers ``index`` in the multibody ``body`` of ``model``."""
    surface = model.merged.links[model.link_name(body, index)].surface
    return ALL_BITS if surface is None or surface.bitmask is None else surface.bitmask
