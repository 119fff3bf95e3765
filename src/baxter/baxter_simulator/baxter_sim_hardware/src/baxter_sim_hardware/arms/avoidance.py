# SPDX-License-Identifier: BSD-3-Clause
"""The field that keeps the arms away from the head: it slows approaching arms and stops them at the guards.

The description has two balls around the head. They are no bodies: nothing collides with them. An arm is modelled as a
chain of capsules from elbow to tip, as thick as its links. When the commanded motion would bring a capsule nearer to a
ball, all joints of the arm are slowed, so that the approach speed is at most proportional to the gap. Motion away is
free.
"""
import math
from typing import NamedTuple

import numpy as np

from numba_cache import compiler

_compiled = compiler("baxter_sim_hardware", [__file__], error_model="numpy")

# [s] The approach speed is at most the gap divided by this time: an elbow at 1 m/s is slowed from 0.15 m on, by less
# than the set-points' own deceleration.
CLOSING_S = 0.15
FIELD_M = 0.03  # within this distance of a guard, an arm counts as being in the field
# The first joint of an arm whose link comes near the head: e0, the elbow's. The links from there on are the chain of
# capsules.
FIRST_JOINT = 2


class Guards(NamedTuple):
    """k balls: their names, centres (k, 3) in the base frame [m], radii (k,) with the arms' own thickness [m]."""

    names: tuple
    centres: np.ndarray
    radii: np.ndarray


class Field(NamedTuple):
    """The guards' result for one arm: names of the near guards, and the share of its speed, 0 to 1, that it may
    keep."""

    near: tuple
    slowing: float


FREE = Field((), 1.0)


def field(guards, rotations, origins, rates):
    """The `Field` of an arm.

    rotations (n + 1, 3, 3), origins (n + 1, 3): frames in base of its joints, whose z are the axes, and of the tip;
    rates (n,): the speeds at which its joints would move [rad/s].
    """
    if not guards.names:
        return FREE
    distances, slowing = _distances(guards.centres, guards.radii, rotations, origins, rates)
    return Field(tuple(name for name, distance in zip(guards.names, distances, strict=True) if distance < FIELD_M),
                 slowing)


@_compiled
def _distances(centres, radii, rotations, origins, rates):
    """((k,) distances of the balls from the arm [m], negative inside; the share of its speed that an arm may have)."""
    distances, slowing = np.full(len(centres), np.inf), 1.0
    for ball in range(len(centres)):
        for link in range(FIRST_JOINT, len(origins) - 1):
            start, along = origins[link], origins[link + 1] - origins[link]
            away = centres[ball] - start
            length = (along * along).sum()
            part = min(max((away * along).sum() / length, 0.0), 1.0) if length > 0.0 else 0.0
            near = start + part * along
            to_centre = centres[ball] - near
            reach = math.sqrt((to_centre * to_centre).sum())
            distance = reach - radii[ball]
            distances[ball] = min(distances[ball], distance)
            closing = 0.0
            for joint in range(link + 1):
                axis, arm = rotations[joint, :, 2], near - origins[joint]
                closing += rates[joint] * (to_centre[0] * (axis[1] * arm[2] - axis[2] * arm[1])
                                           + to_centre[1] * (axis[2] * arm[0] - axis[0] * arm[2])
                                           + to_centre[2] * (axis[0] * arm[1] - axis[1] * arm[0]))
            closing /= max(reach, 1e-9)
            allowed = max(distance, 0.0) / CLOSING_S
            if closing > allowed:
                slowing = min(slowing, allowed / closing)
    return distances, slowing
