# SPDX-License-Identifier: BSD-3-Clause
"""Baxter's control logic: arbitrates arm commands and defines the behaviour while disabled."""
from .arms.control import COMMAND_TIMEOUT_S, SPEED_RATIO, Arms
from .errors import HardwareError
from .robot_state import RobotState

DISABLED_BEHAVIOURS = ("hold", "sink")


class Baxter:
    """The robot's state and its arms, one tick at a time.

    limbs, limits, measured, dt: as for `Arms`; profile: 'sim' or 'robot' (speed ratio at start); disabled: behaviour of
    the arms without power, 'hold' or 'sink'; state: the first robot_state.State.

    Attributes: `profile`; `state`, a `RobotState`; `arms`, an `Arms`; `measured`, the `Measured` that the caller
    updates before each tick, and before each event between two ticks.
    """

    def __init__(self, limbs, limits, measured, dt=0.002, profile="sim", disabled="hold", state=None):
        if profile not in SPEED_RATIO:
            raise HardwareError("profile is '%s'; choices are %s" % (profile, ", ".join(SPEED_RATIO)))
        if disabled not in DISABLED_BEHAVIOURS:
            raise HardwareError("disabled is '%s'; choices are %s" % (disabled, ", ".join(DISABLED_BEHAVIOURS)))
        self.profile = profile
        self.state = RobotState() if state is None else RobotState(state)
        self.measured = measured
        self.arms = Arms(limbs, limits, self.measured, speed_ratio=SPEED_RATIO[profile], dt=dt)
        self.arms.stop()
        self._sinks = disabled == "sink"
        self._speed_ratio = SPEED_RATIO[profile]

    def take_over(self):
        """Start with moving arms: forget every command, bring them to rest, and hold them."""
        self.arms.take_over()
        self.arms.stop()

    def apply(self, event):
        """Take an enable, disable, stop, reset ... event. Raises CommandRefused if the state does not allow it."""
        was_enabled = self.state.enabled
        self.state.apply(event)
        if self.state.enabled != was_enabled:
            # Earlier commands are forgotten.
            self.arms.stop()

    def restore_settings(self):
        """Speed ratios and command time-outs of all limbs as they were at the start."""
        for side in self.arms.sides:
            self.arms.set_speed_ratio(side, self._speed_ratio)
            self.arms.set_timeout(side, COMMAND_TIMEOUT_S)

    def command(self, side, mode, names, values):
        """Pass one joint command to a limb, as `Arms.command`. Raises CommandRefused also while disabled."""
        self.state.require_enabled()
        return self.arms.command(side, mode, names, values)

    @property
    def moves_by_gravity(self):
        """Whether drives follow from the torque that balances gravity, so that `update` needs its present value."""
        return self.arms.needs_gravity or (self._sinks and not self.state.enabled)

    def update(self):
        """Drives of the arms for this tick; measured.gravity counts only where `moves_by_gravity`."""
        if self._sinks and not self.state.enabled:
            return self.arms.sink()
        return self.arms.update()
