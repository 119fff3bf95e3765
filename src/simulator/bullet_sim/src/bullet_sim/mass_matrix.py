# SPDX-License-Identifier: BSD-3-Clause
"""The inertia of moving links, and the joint-space inertia from it where Bullet does not compute that."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from urdf_model import bounds

from .shapes import principal_axes

if TYPE_CHECKING:
    from urdf_model import Inertial

    from .model import Model

# Mass of a moving body whose description gives none: a gram.
ASSUMED_MASS_KG = 1e-3


def moving_inertial(inertial: Inertial) -> tuple[float, np.ndarray, np.ndarray]:
    """Return mass [kg], principal moments (3,) [kg m^2] and their axes (3, 3) of a moving link as the physics uses it.

    A mass below ``bounds.MIN_MASS_KG`` becomes ASSUMED_MASS_KG, and a moment is at least
    ``bounds.MIN_INERTIA_PER_MASS_M2`` times the mass.
    """
    mass = inertial.mass if inertial.mass >= bounds.MIN_MASS_KG else ASSUMED_MASS_KG
    moments, axes = principal_axes(inertial.inertia)
    return mass, np.maximum(moments, bounds.MIN_INERTIA_PER_MASS_M2 * mass), axes


def mass_matrix_of(model: Model) -> np.ndarray:
    """Return the inertia (m, m) of a :class:`Model` at its present position.

    In the order of its n joints; then of three translations and three rotations of each root that is free.
    """
    joints, roots = list(model.merged.joints.values()), model.merged.roots[1 if model.static else 0:]
    index = {joint.child: i for i, joint in enumerate(joints)}
    column_of = {root: len(joints) + 6 * number for number, root in enumerate(roots)}
    frames = {body: model.body_frame(body) for body in (*index, *roots)}
    axes = [frames[joint.child][:3, :3] @ joint.axis for joint in joints]
    matrix = np.zeros((len(joints) + 6 * len(roots),) * 2)
    for child, frame in frames.items():
        inertial, rotation = model.merged.links[child].inertial, frame[:3, :3]
        centre = frame[:3, 3] + rotation @ inertial.centre
        mass, moments, axes_of_link = moving_inertial(inertial)
        moved, turned = np.zeros((3, len(matrix))), np.zeros((3, len(matrix)))
        link = child
        while link in index:
            i = index[link]
            if joints[i].type == "prismatic":
                moved[:, i] = axes[i]
            else:
                moved[:, i], turned[:, i] = np.cross(axes[i], centre - frames[link][:3, 3]), axes[i]
            link = joints[i].parent
        if link in column_of:
            first = column_of[link]
            moved[:, first:first + 3] = turned[:, first + 3:first + 6] = np.eye(3)
            moved[:, first + 3:first + 6] = np.cross(np.eye(3), centre - frames[link][:3, 3]).T
        turned = (rotation @ axes_of_link).T @ turned
        matrix += mass * moved.T @ moved + turned.T @ (moments[:, None] * turned)
    return matrix
