# SPDX-License-Identifier: BSD-3-Clause
"""Names of models and links as the Gazebo services use them, and poses relative to them. ROS-free."""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bullet_sim import Pose

if TYPE_CHECKING:
    from collections.abc import Iterable

    from bullet_sim import Model, World

#: Reference frames that mean the world.
WORLD_FRAMES = ("", "world", "map", "/map")


class UnknownEntity(Exception):
    """There is no model, link or frame of that name; the text lists the known ones."""


def _known(names: Iterable[str]) -> str:
    return ", ".join(names) or "none"


class Entities:
    """Looks things up in a :class:`bullet_sim.World`."""

    def __init__(self, world: World) -> None:
        """``world``: a ``bullet_sim.World``."""
        self._world = world

    def model(self, name: str) -> Model:
        """The ``bullet_sim.Model``; raises :class:`UnknownEntity`."""
        try:
            return self._world.models[name]
        except KeyError:
            raise UnknownEntity("model '%s' does not exist; models: %s"
                                % (name, _known(self._world.models))) from None

    def link(self, scoped: str) -> tuple[Model, str]:
        """``model::link``, or a link's name that only one model has -> (model, link name).

        Raises :class:`UnknownEntity`.
        """
        # A model's name may have a :: itself.
        within = max((name for name in self._world.models if scoped.startswith(name + "::")), key=len, default=None)
        model_name = scoped.partition("::")[0] if within is None else within
        if "::" not in scoped:
            owners = [model for model in self._world.models.values() if scoped in model.link_names]
            if len(owners) == 1:
                return owners[0], scoped
            found = "; several models have it: %s" % _known([model.name for model in owners]) if owners else ""
            raise UnknownEntity("link '%s' not found; scope the link by its model's name: model::link%s"
                                % (scoped, found))
        model, link_name = self.model(model_name), scoped[len(model_name) + 2:]
        if link_name not in model.link_names:
            raise UnknownEntity("model '%s' has no link '%s'; links: %s"
                                % (model_name, link_name, _known(model.link_names)))
        return model, link_name

    def joint(self, name: str) -> tuple[Model, str]:
        """A joint's name -> (the first model with such a joint, joint name); also ``model::joint``.

        Raises :class:`UnknownEntity`.
        """
        for model in self._world.models.values():
            if name in model.joint_names:
                return model, name
            if name.startswith(model.name + "::") and name[len(model.name) + 2:] in model.joint_names:
                return model, name[len(model.name) + 2:]
        known = [joint for model in self._world.models.values() for joint in model.joint_names]
        raise UnknownEntity("joint '%s' not found; joints that move: %s" % (name, _known(known)))

    def frame(self, name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Pose and velocity of the reference frame ``name``: (4x4 matrix in the world, linear, angular velocity).

        The world, a model, or a link as ``model::link``; a link's plain name where no model has it, as in Gazebo the
        first model's. Raises :class:`UnknownEntity`.
        """
        if name in WORLD_FRAMES:
            return np.eye(4), np.zeros(3), np.zeros(3)
        models = self._world.models
        if name in models:
            model = models[name]
            linear, angular = model.model_twist()
            return model.model_pose().matrix(), np.asarray(linear), np.asarray(angular)
        if "::" in name:
            model, link_name = self.link(name)
        else:
            model, link_name = next((model for model in models.values() if name in model.link_names), None), name
        if model is None:
            raise UnknownEntity("reference frame '%s' is no model and no link; models: %s" % (name, _known(models)))
        linear, angular = model.link_twist(link_name)
        return model.link_pose(link_name).matrix(), np.asarray(linear), np.asarray(angular)

    def pose_in_world(self, pose: Pose, reference: str) -> Pose:
        """Transform a :class:`Pose` from the frame ``reference`` to the world."""
        if reference in WORLD_FRAMES:
            return pose
        return Pose.from_matrix(self.frame(reference)[0] @ pose.matrix())

    def relative(self, pose: Pose, linear: np.ndarray, angular: np.ndarray,
                 reference: str) -> tuple[Pose, np.ndarray, np.ndarray]:
        """Pose and velocities of the world, seen from ``reference``: (Pose, linear, angular).

        Velocities are differences to those of the frame's origin, in the frame's axes, as Gazebo has them.
        """
        if reference in WORLD_FRAMES:
            return pose, linear, angular
        frame, frame_linear, frame_angular = self.frame(reference)
        rotation = frame[:3, :3].T
        return (Pose.from_matrix(np.linalg.inv(frame) @ pose.matrix()),
                rotation @ (np.asarray(linear) - frame_linear), rotation @ (np.asarray(angular) - frame_angular))
