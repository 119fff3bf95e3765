# SPDX-License-Identifier: BSD-3-Clause
"""Viscous damping of a model's joints, bounded where Bullet's integration would become unstable."""

import math

import numpy as np

from .quiet_pybullet import pybullet

# Bullet applies joint damping explicitly: beyond inertia / time step it adds energy. Half of that is safe.
_MARGIN = 0.5


class JointDamping:
    """The damping of each joint of a :class:`Model`, bounded by the length of a tick."""

    def __init__(self, model, client, time_step_s, wanted):
        """``client``: PyBullet's; ``wanted``: {joint index: damping [Nm s/rad or N s/m]}; the others have none."""
        self._model = model
        self._client = client
        self._time_step_s = time_step_s
        #: (n,) as it acts [Nm s/rad or N s/m].
        self.values = np.zeros(len(model.joint_names))
        self._wanted = {}
        self._bounds = None
        for index, damping in wanted.items():
            self.set(index, damping)

    def set(self, index, damping):
        """Set the damping of joint ``index``, as far as it is stable."""
        self._wanted[index] = damping
        self.values[index] = min(damping, self._stable()[index])
        self._tell(index)

    def step_changed(self, time_step_s):
        """Adapt the bounds to a new length of a tick [s]."""
        self._time_step_s, self._bounds = time_step_s, None
        for index, damping in self._wanted.items():
            self.set(index, damping)

    def restore(self):
        """Set all damping again, on a rebuilt multibody."""
        for index in range(len(self.values)):
            self._tell(index)

    def _tell(self, index):
        pybullet.changeDynamics(self._model.body, index, jointDamping=self.values[index], physicsClientId=self._client)

    def _stable(self):
        """(n,) The largest damping of each joint that is certainly stable at the present position."""
        model = self._model
        if self._bounds is None:
            felt = np.full(len(self.values), math.inf)
            if model.static:
                # The inertia that a joint feels when the others are free to give way is 1 / (M^-1)_ii.
                felt = 1.0 / np.diag(np.linalg.inv(model.mass_matrix(model.read_joints()[0])))
            self._bounds = _MARGIN * felt / self._time_step_s
        return self._bounds
