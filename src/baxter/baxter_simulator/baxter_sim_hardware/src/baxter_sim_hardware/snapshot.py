# SPDX-License-Identifier: BSD-3-Clause
"""The robot's joints after a physics step, for the messages."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np

    from bullet_sim import Model


class JointSnapshot:
    """The model's joints after a step; expensive values are computed once, and only on demand.

    position [rad, m], velocity, effort [Nm, N]: (n,) each, in the model's order; before: the same three when the step
    began, None where there was none since the joints were put there; sense: function (position, velocity, effort) ->
    the same three as the robot says them; correct: function (efforts, position) that makes efforts of the whole
    description those that the robot's controllers know of.
    """

    def __init__(self, model: Model, before: tuple[np.ndarray, np.ndarray, np.ndarray] | None, dt: float,
                 sense: Callable[[np.ndarray, np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]],
                 correct: Callable[[np.ndarray, np.ndarray], None]) -> None:
        self.position, self.velocity, self.effort = model.read_joints()
        self.before = (self.position, self.velocity, self.effort) if before is None else before
        self._has_stepped = before is not None
        self._model, self._dt = model, dt
        self._sense, self._correct = sense, correct
        self._gravity = self._own_effort = self._sensed = None

    @property
    def sensed(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(position, velocity, effort) as the robot's own sensors have them, (n,) each."""
        if self._sensed is None:
            self._sensed = self._sense(self.position, self.velocity, self.effort)
        return self._sensed

    @property
    def gravity(self) -> np.ndarray:
        """(n,) effort that balances gravity, as far as the robot knows it [Nm, N]."""
        if self._gravity is None:
            self._gravity = self._model.gravity_efforts(self.position)
            self._correct(self._gravity, self.position)
        return self._gravity

    @property
    def own_effort(self) -> np.ndarray:
        """(n,) effort for the robot's own weight, motion and joint damping in the last step [Nm, N]; the rest of the
        effort acts on touched bodies."""
        if self._own_effort is None and not self._has_stepped:
            self._own_effort = self.effort.copy()
        if self._own_effort is None:
            position, velocity, _ = self.before
            acceleration = (self.velocity - velocity) / self._dt
            self._own_effort = self._model.inverse_dynamics(position, velocity, acceleration)
            self._own_effort += self._model.damping * velocity
            self._correct(self._own_effort, position)
        return self._own_effort
