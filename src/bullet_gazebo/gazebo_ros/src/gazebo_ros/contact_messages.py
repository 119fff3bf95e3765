# SPDX-License-Identifier: BSD-3-Clause
"""Contacts of the world as ``gazebo_msgs/ContactState``."""
import numpy as np
from gazebo_msgs.msg import ContactState
from geometry_msgs.msg import Vector3, Wrench


def contact_states(contacts, about=None):
    """List of ContactState, one for each pair of links among ``contacts``, a list of ``bullet_sim.Contact``.

    ``about``: (model, link): only contacts of this link, which then comes first in each; forces act on the first link.
    """
    touching = {}
    for contact in contacts:
        sides = ((contact.model_a, contact.link_a), (contact.model_b, contact.link_b))
        if about is not None and about not in sides:
            continue
        # The normal points from b to a: turned, where the wanted link is b.
        mine, other, sign = (*sides, 1.0) if about in (None, sides[0]) else (*sides[::-1], -1.0)
        touching.setdefault((mine, other), []).append((contact, sign))
    return [_contact_state(mine, other, points) for (mine, other), points in touching.items()]


def _contact_state(mine, other, points):
    state = ContactState(collision1_name="%s::%s" % mine, collision2_name="%s::%s" % other)
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
