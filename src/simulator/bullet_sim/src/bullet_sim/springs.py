# SPDX-License-Identifier: BSD-3-Clause
"""Springs in a model's joints, bounded where their integration would become unstable."""

from __future__ import annotations

import weakref
from typing import TYPE_CHECKING

import numpy as np

from .quiet_pybullet import pybullet

if TYPE_CHECKING:
    from collections.abc import Sequence

    from urdf_model import Joint

    from .model import Model

# A spring swings with sqrt(stiffness / inertia); above 2 / time step an explicit step adds energy. Half of it is safe.
_MAX_TURN_PER_STEP = 1.0


class JointSprings:
    """The springs of a :class:`Model`: effort = stiffness * (reference - position)."""

    def __init__(self, model: Model, joints: Sequence[Joint], inertia: np.ndarray, time_step_s: float) -> None:
        """``joints``: the urdf_model.Joint of the model, in its order; ``inertia`` (n,): what each feels [kg m^2 or
        kg]."""
        self._model = weakref.proxy(model)  # its owner
        self._index = np.array([i for i, joint in enumerate(joints) if joint.spring_stiffness])
        self._reference = np.array([joints[i].spring_reference for i in self._index])
        self._wanted = np.array([joints[i].spring_stiffness for i in self._index])
        self._inertia = inertia[self._index]
        #: (k,) as they act [Nm/rad or N/m].
        self.stiffness = self._wanted
        self.step_changed(time_step_s)

    def step_changed(self, time_step_s: float) -> None:
        """Adapt the bounds to a new length of a tick [s]."""
        self.stiffness = np.minimum(self._wanted, self._inertia * (_MAX_TURN_PER_STEP / time_step_s) ** 2)

    def bounded(self) -> dict[str, tuple[float, float]]:
        """Return {joint's name: (stiffness as written, stiffness that acts)} of the springs that are too stiff."""
        return {self._model.joint_names[i]: (wanted, used)
                for i, wanted, used in zip(self._index, self._wanted, self.stiffness, strict=True) if used < wanted}

    def push(self) -> None:
        """Before a step: apply the efforts."""
        effort = self.stiffness * (self._reference - self._model.read_joints()[0][self._index])
        self._model.parts.command(self._index, pybullet.TORQUE_CONTROL, forces=effort.tolist())
