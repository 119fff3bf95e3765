# SPDX-License-Identifier: BSD-3-Clause
"""External loads of the joints, as a mean over some ticks: the momentum that motors and weight do not explain.

A blow changes the speed of an arm in one tick, between two looks at it. A mean since the last look does not miss it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    from bullet_sim import Model


class ExternalLoad:
    """model: of bullet_sim, with all of the robot's joints; correct: function (efforts, position, gravity) -> None that
    makes efforts of the whole description those that the robot knows of; dt: length of a tick [s].

    Attribute `position`: (n,) [rad, m] where the joints were in the middle of the ticks, once there was a `mean`.
    """

    def __init__(self, model: Model, correct: Callable[[np.ndarray, np.ndarray], None], dt: float) -> None:
        self._model, self._correct, self._dt = model, correct, dt
        self._lower, self._upper = model.lower, model.upper
        self.forget()

    def forget(self) -> None:
        """The joints were put elsewhere: begin again."""
        self._ticks = 0
        self._begin: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None

    def note(self, joints: tuple[np.ndarray, np.ndarray, np.ndarray]) -> None:
        """One tick has ended; joints: (position, velocity, effort) of the model, (n,) each."""
        if self._begin is None:
            self._begin = joints
            self._effort = np.zeros(len(joints[2]))
            return
        self._effort += joints[2]
        self._end = joints
        self._ticks += 1

    def mean(self) -> tuple[np.ndarray, np.ndarray] | None:
        """((n,) efforts that were exerted, (n,) those for the robot's own weight and motion) since the last call
        [Nm, N], or None if no tick has ended since. At the end of its way a joint is held from outside: nothing is told
        of it."""
        if self._begin is None or not self._ticks:
            return None
        (before, speed_before, _), (after, speed_after, _) = self._begin, self._end
        exerted = self._effort / self._ticks
        acceleration = (speed_after - speed_before) / (self._ticks * self._dt)
        self.position, velocity = 0.5 * (before + after), 0.5 * (speed_before + speed_after)
        own = self._model.inverse_dynamics(self.position, velocity, acceleration) + self._model.damping * velocity
        self._correct(own, self.position)
        at_end = (after <= self._lower) | (after >= self._upper)
        own[at_end] = exerted[at_end]
        self._begin, self._ticks = self._end, 0
        self._effort[:] = 0.0
        return exerted, own
