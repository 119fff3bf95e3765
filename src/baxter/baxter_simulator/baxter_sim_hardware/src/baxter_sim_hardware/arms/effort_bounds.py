# SPDX-License-Identifier: BSD-3-Clause
"""How hard the joints' drives may push, and how far a set-point may lead its joint."""
import numpy as np

from .joint_modes import RAW_POSITION

BRAKES_EFFORT_FACTOR = 12.0
# How long brakes push harder than the drives: every joint rests by then. Those that went on would make arms tremble
# that were stopped while they press on something.
BRAKES_S = 0.3
# A set-point leads its joint by no more than this [rad]. The joint motors answer an error of that size with what they
# have; a larger one would only make them overshoot. In free motion the joints stay within a tenth of it.
REACH_RAD = 1e-3
BRAKES_REACH_RAD = 4e-3  # in place of REACH_RAD: a joint that brakes at 640 rad/s^2 may be a tick late
# An arm that touches the robot itself pushes with this share of its effort limits in position and velocity mode.
YIELD_FACTOR = 0.3


class EffortBounds:
    """limit: (n,) [Nm] the joints' effort limits; dt: length of a tick [s].

    Attribute `balanced`: (n,) 1 where torque mode adds the torque that balances gravity, 0 where not.
    """

    def __init__(self, limit, dt):
        self._limit, self._dt = limit, dt
        self.balanced = np.ones(len(limit))
        self._brake_ticks = 0  # left, of BRAKES_S
        self._yielding = np.zeros(len(limit), dtype=bool)
        self._any_yields = False
        self._bound = self._bound_gravity = None  # (n,) the bound without brakes [Nm], and for which gravity that is

    def brake(self, on):
        """The brakes push from now on for BRAKES_S, or are off."""
        self._brake_ticks = round(BRAKES_S / self._dt) if on else 0

    def end_tick(self):
        """A tick is over."""
        if self._brake_ticks:
            self._brake_ticks -= 1

    def set_yielding(self, index, yields):
        """Whether joints `index`, in all modes but raw position, push with no more than YIELD_FACTOR of the limits."""
        self._yielding[index] = yields
        self._any_yields = bool(self._yielding.any())

    @property
    def reach(self):
        """[rad] what a set-point may lead its joint by."""
        return BRAKES_REACH_RAD if self._brake_ticks else REACH_RAD

    def bound(self, gravity, mode):
        """(n,) [Nm] what drives may exert where `gravity` (n,) is what the weight takes of it; mode: (n,)."""
        if self._brake_ticks:
            return BRAKES_EFFORT_FACTOR * self._limit + np.abs(gravity)
        if gravity is not self._bound_gravity:
            self._bound_gravity, self._bound = gravity, self._limit + np.abs(gravity)
        if self._any_yields:
            gentle = self._yielding & (mode != RAW_POSITION)
            return np.where(gentle, YIELD_FACTOR * self._limit + np.abs(gravity), self._bound)
        return self._bound
