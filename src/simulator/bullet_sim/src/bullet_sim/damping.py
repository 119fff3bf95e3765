# SPDX-License-Identifier: BSD-3-Clause
"""Viscous damping of a model's joints, bounded where Bullet's integration would become unstable.

It is not bounded where a description asks for implicit damping (Gazebo's ``implicitSpringDamper``). An implicit step,
(inertia + time step * damping) * change of velocity = time step * (effort - damping * velocity), is an explicit one of
a joint with more inertia: where the damping is too large for the links' own inertia, they get it.
"""

from __future__ import annotations

import math
import weakref
from typing import TYPE_CHECKING

import numpy as np

from .mass_matrix import mass_matrix_of
from .quiet_pybullet import pybullet

if TYPE_CHECKING:
    from collections.abc import Mapping

    from .model import Model

# Bullet applies joint damping explicitly: beyond inertia / time step it adds energy. Half of that is safe.
_MARGIN = 0.5
# Inertia of a link with implicit damping, in units of time step * damping. Links of a chain turn against each other, so
# it takes four times as much as one joint alone.
_OF_A_CHAIN = 4.0


def largest_stable(felt_inertia: np.ndarray, time_step_s: float) -> np.ndarray:
    """(n,) The largest damping [Nm s/rad or N s/m] that is certainly stable for joints that feel `felt_inertia` (n,)
    [kg m^2 or kg] in ticks of time_step_s [s]."""
    return _MARGIN * felt_inertia / time_step_s


class JointDamping:
    """The damping of each joint of a :class:`Model`, bounded by the length of a tick."""

    def __init__(self, model: Model, client: int, time_step_s: float, wanted: Mapping[int, float]) -> None:
        """``client``: PyBullet's; ``wanted``: {joint index: damping [Nm s/rad or N s/m]}; the others have none."""
        # Its owner: no cycle, so that a deleted model is freed at once, and not by a garbage collection, which leaves
        # out what /gazebo has frozen.
        self._model = weakref.proxy(model)
        self._client = client
        self._time_step_s = time_step_s
        #: (n,) as it acts [Nm s/rad or N s/m].
        self.values = np.zeros(len(model.joint_names))
        self._wanted = {}
        self._felt = None
        # A sliding link would become heavier.
        self._implicit = {index for index, joint in enumerate(model.merged.joints.values())
                          if joint.implicit_damping and joint.type != "prismatic"}
        self._added = np.zeros(len(model.joint_names))  # to the moments of inertia of the joints' links [kg m^2]
        for index, damping in wanted.items():
            self.set(index, damping)

    def set(self, index: int, damping: float) -> None:
        """Set the damping of joint ``index``, as far as it is stable."""
        self._wanted[index] = damping
        bound = self._stable()[index]
        if index in self._implicit:
            self._add_inertia(index, _OF_A_CHAIN * self._time_step_s * damping if damping > bound else 0.0)
            bound = math.inf
        self.values[index] = min(damping, bound)
        self._tell(index)

    def step_changed(self, time_step_s: float) -> None:
        """Adapt the bounds to a new length of a tick [s]."""
        self._time_step_s = time_step_s
        for index, damping in self._wanted.items():
            self.set(index, damping)

    def restore(self) -> None:
        """Set all damping again, on a rebuilt multibody."""
        for index in range(len(self.values)):
            self._tell(index)
            self.restore_inertia(index)

    def restore_inertia(self, index: int) -> None:
        """Add what implicit damping takes to the inertia of the link behind joint ``index``, which was set again."""
        added, self._added[index] = self._added[index], 0.0
        self._add_inertia(index, added)

    def _add_inertia(self, index: int, added: float) -> None:
        change, self._added[index] = added - self._added[index], added
        if change:
            place = self._model.parts.places[index]
            moments = pybullet.getDynamicsInfo(*place, physicsClientId=self._client)[2]
            pybullet.changeDynamics(*place, localInertiaDiagonal=[m + change for m in moments],
                                    physicsClientId=self._client)

    def _tell(self, index: int) -> None:
        pybullet.changeDynamics(*self._model.parts.places[index], jointDamping=self.values[index],
                                physicsClientId=self._client)

    def _inertia(self) -> np.ndarray:
        """(m, m) The inertia at the present position, that of the joints first."""
        if not self._model.free:
            try:
                return self._model.mass_matrix(self._model.read_joints()[0])
            except (pybullet.error, SystemError):
                # Bullet refuses a link with a moment larger than the sum of the others, which many descriptions have.
                pass
        return mass_matrix_of(self._model)

    def felt_inertia(self) -> np.ndarray:
        """(n,) The inertia that each joint feels when the others, and a free root, can give way, at the position of the
        first call [kg m^2 or kg]."""
        if self._felt is None:
            self._felt = 1.0 / np.diag(np.linalg.inv(self._inertia()))[:len(self.values)]
        return self._felt

    def _stable(self) -> np.ndarray:
        """(n,) The largest damping of each joint that is certainly stable."""
        return largest_stable(self.felt_inertia(), self._time_step_s)
