# SPDX-License-Identifier: BSD-3-Clause
"""Contacts of the world as ``gazebo_msgs/ContactState``, with the names of Gazebo's collisions."""
from __future__ import annotations

import weakref
from typing import TYPE_CHECKING

import numpy as np
from gazebo_msgs.msg import ContactState
from geometry_msgs.msg import Vector3, Wrench

from urdf_model import CollisionName, collision_names
from urdf_model.distance import distance_from
from urdf_model.transforms import inverse

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable

    from bullet_sim import ContactPoint, Model, World


class CollisionNames:
    """Names of the collisions of a ``bullet_sim.World``, as Gazebo has them: ``model::link::collision``."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._known = weakref.WeakKeyDictionary()  # Model -> {body: [(shape, CollisionName)]}

    def of_link(self, model: Model, link: str) -> dict[str, str]:
        """Return the names in a link of Gazebo, of a ``bullet_sim.Model``: {plain name: full name}."""
        return {name.name: _full(model.name, name) for rows in self._rows(model).values() for _, name in rows
                if name.link == link}

    def at(self, model_name: str, body: str, position: Iterable[float]) -> str:
        """Return the name of the collision of a model's body that is at or next to ``position`` (3,) [m, world]."""
        model = self._world.models[model_name]
        rows = self._rows(model)[body]
        if not rows:
            return _full(model_name, CollisionName(body, "collision"))
        if len(rows) == 1:
            return _full(model_name, rows[0][1])
        frame = model.link_pose(body).matrix() @ inverse(model.merged.frames[body].offset)
        point = (inverse(frame) @ (*position, 1.0))[:3]
        return _full(model_name, min(rows, key=lambda row: abs(distance_from(row[0], point)))[1])

    def _rows(self, model):
        if model not in self._known:
            names, counts, found = collision_names(model.robot), {}, {}
            for body, link in model.merged.links.items():
                found[body] = []
                for shape in link.collisions:
                    number = counts[shape.link] = counts.get(shape.link, -1) + 1
                    name = names.get((shape.link, number), CollisionName(body, "collision"))
                    found[body].append((shape, name))
            self._known[model] = found
        return self._known[model]


def _full(model_name: str, name: CollisionName) -> str:
    return "%s::%s::%s" % (model_name, *name)


def contact_states(contacts: Iterable[ContactPoint], names: CollisionNames,
                   about: Collection[str] | None = None) -> list[ContactState]:
    """List of ContactState, one for each pair of collisions among ``contacts``, a list of ``bullet_sim.Contact``.

    ``names``: :class:`CollisionNames`; ``about``: names of collisions: only their contacts, in which they come first;
    forces act on the first one.
    """
    touching = {}
    for contact in contacts:
        sides = (names.at(contact.model_a, contact.link_a, contact.position),
                 names.at(contact.model_b, contact.link_b, contact.position))
        # The normal points from b to a: turned, where the wanted collision is b.
        if about is None or sides[0] in about:
            touching.setdefault(sides, []).append((contact, 1.0))
        elif sides[1] in about:
            touching.setdefault(sides[::-1], []).append((contact, -1.0))
    return [_contact_state(mine, other, points) for (mine, other), points in touching.items()]


def _contact_state(mine: str, other: str, points: list[tuple[ContactPoint, float]]) -> ContactState:
    state = ContactState(collision1_name=mine, collision2_name=other)
    state.info = "%d contact points" % len(points)
    total = np.zeros(3)
    for contact, sign in points:
        normal = sign * np.asarray(contact.normal)
        force = contact.force * normal + sign * np.asarray(contact.friction)
        total += force
        state.wrenches.append(Wrench(force=Vector3(*force)))
        state.contact_positions.append(Vector3(*contact.position))
        state.contact_normals.append(Vector3(*normal))
        state.depths.append(max(-contact.distance, 0.0))
    state.total_wrench.force = Vector3(*total)
    return state
