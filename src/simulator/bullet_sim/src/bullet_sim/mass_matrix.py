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
    tree = _Tree(model)
    matrix = np.zeros((tree.width,) * 2)
    for child, frame in tree.frames.items():
        inertial, rotation = model.merged.links[child].inertial, frame[:3, :3]
        mass, moments, axes_of_link = moving_inertial(inertial)
        moved, turned = tree.motions(child, frame[:3, 3] + rotation @ inertial.centre)
        turned = (rotation @ axes_of_link).T @ turned
        matrix += mass * moved.T @ moved + turned.T @ (moments[:, None] * turned)
    return matrix


def motion_of_point(model: Model, body: str, point: np.ndarray) -> np.ndarray:
    """Return how a ``point`` (3,) [m, world] of a body moves (3, m), by the columns of :func:`mass_matrix_of`."""
    return _Tree(model).motions(body, point)[0]


class _Tree:
    """The frames of a model's moving bodies at its present position, and the columns of its motions."""

    def __init__(self, model: Model) -> None:
        roots = model.merged.roots[1 if model.static else 0:]
        self._joints = list(model.merged.joints.values())
        self._index = {joint.child: i for i, joint in enumerate(self._joints)}
        self._column_of = {root: len(self._joints) + 6 * number for number, root in enumerate(roots)}
        self.frames = {body: model.body_frame(body) for body in (*self._index, *roots)}
        self._axes = [self.frames[joint.child][:3, :3] @ joint.axis for joint in self._joints]
        self.width = len(self._joints) + 6 * len(roots)

    def motions(self, body: str, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The velocity of a point (3,) of a body and its turn rate, for each motion: (3, m) each."""
        moved, turned = np.zeros((3, self.width)), np.zeros((3, self.width))
        link = body
        while link in self._index:
            i = self._index[link]
            if self._joints[i].type == "prismatic":
                moved[:, i] = self._axes[i]
            else:
                moved[:, i] = np.cross(self._axes[i], point - self.frames[link][:3, 3])
                turned[:, i] = self._axes[i]
            link = self._joints[i].parent
        if link in self._column_of:
            first = self._column_of[link]
            moved[:, first:first + 3] = turned[:, first + 3:first + 6] = np.eye(3)
            moved[:, first + 3:first + 6] = np.cross(np.eye(3), point - self.frames[link][:3, 3]).T
        return moved, turned
