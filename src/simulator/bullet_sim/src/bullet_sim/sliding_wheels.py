# SPDX-License-Identifier: BSD-3-Clause
"""Friction of wheels that slide: against their motion over the floor.

Bullet bounds the friction of a contact by a cone, but finds its direction by what each direction weighs: forwards a
light wheel, sideways the whole vehicle. So a vehicle with fixed wheels, which must slide to turn, hardly turns. Here
the difference between Coulomb's friction and that of the last step acts on the wheel in the next step.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from .builder import most_friction
from .directions import directed
from .quiet_pybullet import pybullet

if TYPE_CHECKING:
    from collections.abc import Iterable

    from urdf_model import Joint

    from .model import Model

# Slower contacts roll, and Bullet's friction is right [m/s].
_CREEP_M_PER_S = 0.02
# Contacts with less than this share of the largest friction stick. Towards the whole the correction grows steeply.
_STICKS, _STEEPNESS = 0.6, 8
# Contacts farther from the wheel's centre are from before the vehicle was put elsewhere [m].
_REACH_M = 1.0
# Wheels whose places on the vehicle differ by less are on the same axle [m], and directions of axles [1].
_SAME = 1e-3
# The smallest part of the larger coefficient that the other one has [1].
_LEAST = 1e-3


def fixed_wheels(joints: Iterable[Joint]) -> list[int]:
    """Indices of the ``joints`` (urdf_model.Joint, in the order of the model) of wheels that cannot all roll when the
    vehicle turns: on several axles with the same direction on the same link."""
    axles = {}
    for index, joint in enumerate(joints):
        if joint.type == "continuous":
            direction, place = joint.origin[:3, :3] @ joint.axis, joint.origin[:3, 3]
            direction = direction / np.linalg.norm(direction)
            across = place - direction * (place @ direction)
            axles.setdefault(joint.parent, []).append((index, direction, across))
    found = set()
    for group in axles.values():
        for index, direction, across in group:
            beside = [other for other in group if np.linalg.norm(np.cross(direction, other[1])) < _SAME]
            if any(np.linalg.norm(across - other[2]) > _SAME for other in beside):
                found.add(index)
    return sorted(found)


def sliding_wheels(client: int, model: Model) -> list[SlidingWheels]:
    """Return the SlidingWheels of a Model, a list; ``client``: PyBullet's."""
    trees = {}
    joints = list(model.merged.joints.values())
    for index in fixed_wheels(joints):
        if joints[index].child in model.own_directions:
            continue
        trees.setdefault(model.parts.root_of(index), []).append(model.parts.places[index].index)
    return [SlidingWheels(client, model, root, wheels) for root, wheels in trees.items()]


def _parts(joint: Joint, model: Model) -> tuple[float, float, float]:
    """For ``SlidingWheels._parts_of``, of the wheel behind a joint."""
    found = directed(model.merged.links[joint.child].surface, most_friction(joint))
    if found is None or found.direction is not None:
        return (1.0, 1.0, 1.0)
    most = max(found.along, found.across)
    return (max(found.across / most, _LEAST), max(found.along / most, _LEAST), 1.0)


class SlidingWheels:
    """The fixed wheels on one root of a model."""

    def __init__(self, client: int, model: Model, root: int, wheels: Iterable[int]) -> None:
        """``client``: PyBullet's; ``model``: a Model, ``root``: index of its root; ``wheels``: PyBullet's numbers of
        their joints."""
        self._client, self._model, self._root, self._wheels = client, model, root, frozenset(wheels)
        #: {wheel: the parts (3,) of its larger coefficient that its friction has along the world's axes}
        self._parts_of = {model.parts.places[index].index: _parts(joint, model)
                          for index, joint in enumerate(model.merged.joints.values())}
        self._surfaces = {}  # (body, link) -> (friction, does it stand still)

    def models_changed(self) -> None:
        """A model was added or removed: PyBullet gives the number of a removed body to a new one."""
        self._surfaces = {}

    def correct(self) -> None:
        """Before a step: push the wheels that slid in the last one."""
        rows = self._sliding()
        if not rows:
            return
        links, body = sorted({row[0] for row in rows}), self._body
        states = pybullet.getLinkStates(body, links, computeLinkVelocity=1, physicsClientId=self._client)
        moving = {link: (state[0], state[6], state[7]) for link, state in zip(links, states, strict=True)}
        place, normal, friction = (np.array([row[k] for row in rows]) for k in (1, 2, 3))
        most, parts = np.array([row[4] for row in rows]), np.array([self._parts_of[row[0]] for row in rows])
        centre, linear, angular = (np.array([moving[row[0]][k] for row in rows]) for k in range(3))
        arm = place - centre
        slip = linear + np.cross(angular, arm)
        slip -= normal * np.sum(slip * normal, axis=1)[:, None]
        speed = np.linalg.norm(slip, axis=1)
        share = np.minimum(1.0, np.linalg.norm(friction / parts, axis=1) / most) ** _STEEPNESS
        share *= np.minimum(1.0, speed / _CREEP_M_PER_S)
        share *= np.linalg.norm(arm, axis=1) < _REACH_M
        # Of the forces in the ellipse, the one that takes most power from the slip.
        coulomb = -slip * parts ** 2 * (most / np.maximum(np.linalg.norm(slip * parts, axis=1), 1e-9))[:, None]
        forces = (coulomb - friction) * share[:, None]
        for row, force in zip(rows, forces.tolist(), strict=True):
            pybullet.applyExternalForce(body, row[0], force, row[1], pybullet.WORLD_FRAME,
                                        physicsClientId=self._client)

    @property
    def _body(self) -> int:
        """PyBullet's number of the multibody."""
        return self._model.parts.places[self._root].body

    def _sliding(self) -> list[tuple]:
        """Contacts of the wheels near the bound of their friction, with things that stand still: rows of link, place,
        normal (towards the wheel), friction on the wheel [N], and its bound [N]."""
        body, found = self._body, []
        for point in pybullet.getContactPoints(bodyA=body, physicsClientId=self._client) or ():
            # The force across the normal acts on the first body, and the normal points to it.
            sign = 1.0 if point[1] == body else -1.0
            link, other = (point[3], (point[2], point[4])) if sign > 0.0 else (point[4], (point[1], point[3]))
            if link not in self._wheels or point[9] <= 0.0:
                continue
            friction, stands = self._surface(other)
            most = point[9] * friction * self._surface((body, link))[0]
            if not (stands and most > 0.0):
                continue
            push = [sign * (point[10] * u + point[12] * v) for u, v in zip(point[11], point[13], strict=True)]
            in_parts = (force / part for force, part in zip(push, self._parts_of[link], strict=True))
            if math.hypot(*in_parts) > _STICKS * most:
                found.append((link, point[5] if sign > 0.0 else point[6], [sign * n for n in point[7]], push, most))
        return found

    def _surface(self, body_and_link: tuple[int, int]) -> tuple[float, bool]:
        if body_and_link not in self._surfaces:
            mass, friction = pybullet.getDynamicsInfo(*body_and_link, physicsClientId=self._client)[:2]
            self._surfaces[body_and_link] = friction, mass == 0.0
        return self._surfaces[body_and_link]
