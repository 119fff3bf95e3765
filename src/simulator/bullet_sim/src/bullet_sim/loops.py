# SPDX-License-Identifier: BSD-3-Clause
"""Joints that close a loop of links, as Bullet's constraints: its multibodies are trees."""

from __future__ import annotations

from typing import TYPE_CHECKING

from urdf_model.transforms import inverse, quaternion_from_matrix

from .multibodies import link_indices
from .pose import Pose
from .quiet_pybullet import pybullet

if TYPE_CHECKING:
    import numpy as np

    from urdf_model import MergedRobot

    from .multibodies import LinkPlace, Multibodies

# A hinge is two points on its axis, so far from the joint [m].
_HALF_HINGE_M = 0.05
# Largest force of a constraint [N, Nm]: more than any linkage bears.
_FORCE = 1e6


def close_loops(client: int, merged: MergedRobot, parts: Multibodies) -> list[int]:
    """Create the constraints of a urdf_model.MergedRobot on its Multibodies, in a posture where the loops are closed.

    ``client``: PyBullet's. Returns PyBullet's numbers of them.
    """
    number, found = link_indices(merged), []
    for loop in merged.loops:
        places = [parts.places[number[link]] for link in (loop.parent, loop.child)]
        frames = [_inertial(client, place) @ frame for place, frame in zip(places, (loop.in_parent, loop.in_child),
                                                                           strict=True)]
        if loop.type in ("fixed", "prismatic"):
            kind = pybullet.JOINT_FIXED if loop.type == "fixed" else pybullet.JOINT_PRISMATIC
            turns = [quaternion_from_matrix(frame).tolist() for frame in frames]
            points = [((frames[0][:3, 3], frames[1][:3, 3]), turns)]
        else:
            kind = pybullet.JOINT_POINT2POINT
            offsets = (0.0,) if loop.type == "ball" else (-_HALF_HINGE_M, _HALF_HINGE_M)
            points = [([(frame @ (*(offset * loop.axis), 1.0))[:3] for frame in frames], ()) for offset in offsets]
        for (in_parent, in_child), turns in points:
            constraint = pybullet.createConstraint(*places[0], *places[1], kind, loop.axis.tolist(), in_parent.tolist(),
                                                   in_child.tolist(), *turns, physicsClientId=client)
            pybullet.changeConstraint(constraint, maxForce=_FORCE, physicsClientId=client)
            found.append(constraint)
    return found


def _inertial(client: int, place: LinkPlace) -> np.ndarray:
    """The frame (4, 4) of a link in its inertial one, which Bullet's constraints refer to."""
    info = pybullet.getDynamicsInfo(*place, physicsClientId=client)
    return inverse(Pose(info[3], info[4]).matrix())
