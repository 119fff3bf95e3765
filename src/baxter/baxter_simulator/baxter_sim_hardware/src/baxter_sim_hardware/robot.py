# SPDX-License-Identifier: BSD-3-Clause
"""Baxter's control logic: arbitrates arm commands and defines the behaviour while disabled."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from .arms.actuators import ActuatorCommands, Actuators
from .arms.control import COMMAND_TIMEOUT_S, SPEED_RATIO, Arms
from .errors import ArmStands, BaxterHardwareError
from .robot_state import RobotState

if TYPE_CHECKING:
    from collections.abc import Sequence

    from baxter_model.description import LimbModel

    from .arms.drives import Drives
    from .arms.joint_command import ArmLimits, CheckedCommand
    from .arms.measured import Measured
    from .robot_state import BaxterState, Event

INERTIA_TICKS = 50  # the inertias of links about their joints change that slowly
DISABLED_BEHAVIOURS = ("hold", "sink")


class Behaviour(NamedTuple):
    """profile: 'sim' or 'robot' (speed ratio at start); disabled: what arms do without power, 'hold' or 'sink';
    actuators: `arms.actuators.Actuators` of all joints of the arms, or None for ideal drives."""

    profile: str = "sim"
    disabled: str = "hold"
    actuators: Actuators | None = None


class BaxterHardware:
    """The robot's state and its arms, one tick at a time.

    limbs, limits, measured, dt: as for `Arms`; behaviour: `Behaviour`; state: the first robot_state.BaxterState.

    Attributes: `profile`, `actuators`: as in `Behaviour`; `state`, a `RobotState`; `arms`, an `Arms`; `measured`, the
    `Measured` that the caller updates before each tick, and before each event between two ticks.
    """

    def __init__(self, limbs: Sequence[LimbModel], limits: ArmLimits, measured: Measured, dt: float = 0.002,
                 behaviour: Behaviour = Behaviour(), state: BaxterState | None = None) -> None:  # noqa: B008 (a tuple)
        profile, disabled, actuators = behaviour
        if profile not in SPEED_RATIO:
            raise BaxterHardwareError("profile is '%s'; choices are %s" % (profile, ", ".join(SPEED_RATIO)))
        if disabled not in DISABLED_BEHAVIOURS:
            raise BaxterHardwareError("disabled is '%s'; choices are %s" % (disabled, ", ".join(DISABLED_BEHAVIOURS)))
        self.profile = profile
        self.state = RobotState() if state is None else RobotState(state)
        self.measured, self.actuators, self._dt = measured, actuators, dt
        # Angles, speeds, and inertias about their joints, of the links.
        self._links, self._inertia_due = np.zeros((3, len(measured.position))), 0
        self.arms = Arms(limbs, limits, self.measured, speed_ratio=SPEED_RATIO[profile], dt=dt,
                         free_speed=None if actuators is None else actuators.free_speed)
        self.arms.stop()
        self._sinks = disabled == "sink"
        self._speed_ratio = SPEED_RATIO[profile]
        self._halted_until = {}  # {side: [s]}

    def take_over(self) -> None:
        """Start with moving arms: forget every command, bring them to rest, and hold them."""
        self.arms.take_over()
        self.arms.stop()

    def put_elsewhere(self) -> None:
        """The joints were put elsewhere: forget every command, and hold them there."""
        self.arms.reset()
        self._halted_until.clear()
        if self.actuators is not None:
            self.actuators.forget()
            self._inertia_due = 0

    def apply(self, event: Event) -> None:
        """Take an enable, disable, stop, reset ... event. Raises CommandRefused if the state does not allow it."""
        was_enabled = self.state.enabled
        self.state.apply(event)
        if self.state.enabled != was_enabled:
            # Earlier commands are forgotten.
            self.arms.stop()

    def restore_settings(self) -> None:
        """Speed ratios and command time-outs of all limbs as they were at the start."""
        for side in self.arms.sides:
            self.arms.set_speed_ratio(side, self._speed_ratio)
            self.arms.set_timeout(side, COMMAND_TIMEOUT_S)

    def command(self, side: str, mode: int, names: Sequence[str], values: Sequence[float]) -> CheckedCommand:
        """Pass one joint command to a limb, as `Arms.command`. Raises CommandRefused also while disabled, and ArmStands
        after a collision."""
        self.state.require_enabled()
        if self.halted(side):
            raise ArmStands("the arm has collided and stands; it takes commands again in %.2f s"
                            % (self._halted_until[side] - self.measured.time_s))
        return self.arms.command(side, mode, names, values)

    def halt(self, side: str, seconds: float) -> None:
        """One limb has collided: hold it where it is now, and refuse its commands for so long."""
        self.arms.hold_here(side)
        if self.actuators is not None:
            joints = self.arms.joints_of(side)
            self.actuators.hold(joints, self.measured.position[joints])
        self._halted_until[side] = self.measured.time_s + seconds

    def halted(self, side: str) -> bool:
        """Whether a limb stands because it has collided."""
        return self.measured.time_s < self._halted_until.get(side, -math.inf)

    @property
    def moves_by_gravity(self) -> bool:
        """Whether drives follow from the torque that balances gravity, so that `update` needs its present value."""
        return self.actuators is not None or self.arms.needs_gravity or (self._sinks and not self.state.enabled)

    def update(self) -> Drives:
        """Drives of the arms for this tick; measured.gravity counts only where `moves_by_gravity`."""
        if self._sinks and not self.state.enabled:
            if self.actuators is not None:
                self.actuators.forget()
            return self.arms.sink()
        drives = self.arms.update()
        return drives if self.actuators is None else self._through(self.actuators, drives)

    def _through(self, actuators: Actuators, drives: Drives) -> Drives:
        arms, measured, index = self.arms, self.measured, drives.position_driven
        driven, effort = np.zeros(len(measured.position), dtype=bool), np.zeros(len(measured.position))
        driven[index], effort[index] = True, drives.effort
        wanted = ActuatorCommands(driven, arms.commanded_position, arms.said_velocity, arms.in_position_mode,
                                  arms.known_gravity, effort)
        if self._inertia_due == 0:
            self._links[2] = np.diagonal(measured.dynamics(measured.velocity)[0])
        self._inertia_due = (self._inertia_due + 1) % INERTIA_TICKS
        self._links[0], self._links[1] = measured.position, measured.velocity
        torques = actuators.torques(wanted, self._links, self._dt)
        drives = drives._replace(position_driven=index[:0], effort_driven=index, exerted=torques[index])
        pushed = drives.velocity_driven
        if not len(pushed):
            return drives
        push = actuators.bounded(np.copysign(drives.push_effort, drives.push_velocity), measured.position, pushed)
        return drives._replace(push_velocity=np.copysign(drives.push_velocity, push), push_effort=np.abs(push))
