# SPDX-License-Identifier: BSD-3-Clause
"""A link that hangs on a frame of the world, which may be moved and let go."""

from __future__ import annotations

from typing import TYPE_CHECKING

from urdf_model.transforms import inverse

from .multibodies import link_indices
from .pose import Pose
from .quiet_pybullet import pybullet

if TYPE_CHECKING:
    from .model import Model


class Hanging:
    """Holds a link of a Model at a Pose of its frame, with a force [N] at most.

    It goes on when the multibody is rebuilt, from the next call of :meth:`hold` on.
    """

    def __init__(self, client: int, model: Model, link: str, most_n: float) -> None:
        """``client``: PyBullet's. Raises BulletSimError for an unknown link."""
        self._client, self._model, self._most = client, model, most_n
        here = model.link_pose(link)
        frame = model.merged.frames[link]
        self._index, self._to_body = link_indices(model.merged)[frame.link], inverse(frame.offset)
        self._parts = self._offset = self._constraint = None
        self.hold(here)

    def hold(self, pose: Pose) -> None:
        """Hold the link at ``pose`` of its frame in the world."""
        if self._parts is not self._model.parts:  # as after the multibody was rebuilt
            self._parts = self._model.parts
            place = self._parts.places[self._index]
            info = pybullet.getDynamicsInfo(*place, physicsClientId=self._client)
            self._offset = self._to_body @ Pose(info[3], info[4]).matrix()
            self._constraint = pybullet.createConstraint(*place, -1, -1, pybullet.JOINT_FIXED, (0, 0, 0), (0, 0, 0),
                                                         (0, 0, 0), physicsClientId=self._client)
        wanted = Pose.from_matrix(pose.matrix() @ self._offset)
        pybullet.changeConstraint(self._constraint, wanted.position, wanted.quaternion, maxForce=self._most,
                                  physicsClientId=self._client)
        self._model.wake()

    def let_go(self) -> None:
        """Let the link go, for ever."""
        if self._constraint is not None and self._parts is self._model.parts:
            pybullet.removeConstraint(self._constraint, physicsClientId=self._client)
        self._constraint = None
        self._model.wake()
