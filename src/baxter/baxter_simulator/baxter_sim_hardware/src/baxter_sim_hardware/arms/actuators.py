# SPDX-License-Identifier: BSD-3-Clause
"""The actuators of a physical arm: a motor with a finite controller, and a spring between it and the link.

Each joint is a series elastic actuator. Its controller sees the motor, not the link:

    motor:  J w' = clip(T, limit) - spring - Coulomb friction,   T = ff + kp (r - m) + I - kd (w - w_ff)
    spring: k (m - q) + d (w - v), which is what drives the link beside its counterbalance
    limit = the torque limit; beyond the motor's speed W it falls, to 0 at 1.5 W, for torque in the direction of motion
    r = filtered set-point + ff / k, ff = torque that balances gravity, as far as the controller knows it

m, w: angle and speed of the motor, seen at the joint; q, v: of the link. So a load that the controller does not know
bends the spring for good, and the error of the motor itself goes away by I, which acts at rest only.

The counterbalance may be stronger than the controller knows, by a share of itself (`counterbalance_excess`). How far
that bends the spring is measured, so an arm at rest is where it should be; the torque comes from I, which is late.

Effort is told from how far the spring is bent, with hysteresis: after a way of some `hysteresis_way` in one direction
all of `effort_hysteresis` is added to it, in that direction.

A bare wrist is so light that its spring would shake it at the length of a tick. So the spring's torque is that of the
tick's end, where a link of the given inertia will be (linearly implicit Euler).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from baxter_sim_hardware import effects
from disk_cache.compiled import compiler

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

_compiled = compiler("baxter_sim_hardware", [__file__], error_model="numpy")

# Parts of a tick in which the motors are moved: spring and motor of a wrist swing at 110 rad/s.
PARTS = 4
# A motor rests where it and its set-point are slower than this [rad/s].
REST_SPEED = 0.03
NUMBERS = ("spring_stiffness", "spring_damping", "motor_inertia", "proportional_gain", "motor_damping", "friction",
           "set_point_filter", "position_mode_filter", "integral_rate", "integral_deadband", "torque_limit",
           "counterbalance_offset", "counterbalance_stiffness", "effort_hysteresis", "hysteresis_way", "motor_speed",
           "counterbalance_excess")
_LIMIT, _OFFSET, _STIFFNESS, _HYSTERESIS, _SPEED, _EXCESS = (NUMBERS.index(name) for name in (
    "torque_limit", "counterbalance_offset", "counterbalance_stiffness", "effort_hysteresis", "motor_speed",
    "counterbalance_excess"))
# Without load a motor turns faster than with its full torque, by this factor.
FREE_SPEED = 1.5


class ActuatorCommands(NamedTuple):
    """Commands of the actuators for one tick, (n,) each.

    driven: which of them follow `position` [rad]; velocity: what set-points are said to move at, 0 where nobody says
    [rad/s]; in_position_mode; known_load: torque that the controller adds for gravity [Nm]; effort: what a drive may
    exert [Nm].
    """

    driven: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    in_position_mode: np.ndarray
    known_load: np.ndarray
    effort: np.ndarray


class Actuators:
    """The actuators of n joints.

    rows: {number: {joint: value}} as `effects.read` has them for "lag"; names: of the joints. Raises
    BaxterHardwareError.
    """

    def __init__(self, rows: Mapping[str, Mapping[str, float]], names: Sequence[str]) -> None:
        self._numbers = np.array([effects.per_joint(rows, number, names) for number in NUMBERS])
        for number, least in (("spring_stiffness", 1.0), ("motor_inertia", 1e-4), ("hysteresis_way", 1e-6),
                              ("motor_speed", 0.1)):
            values = self._numbers[NUMBERS.index(number)]
            if values.min() < least:
                raise effects.BaxterHardwareError("%s is %g; it must be at least %g" % (number, values.min(), least))
        if self._numbers.min() < 0.0:
            raise effects.BaxterHardwareError("%s is negative" % NUMBERS[int(np.argwhere(self._numbers < 0.0)[0, 0])])
        # Motor's angle and speed, filtered set-point, integral, set-point of the tick before, share of the hysteresis,
        # what the controller adds to the known load.
        self._state = np.zeros((7, len(names)))
        self._begun = np.zeros(len(names), dtype=bool)

    def forget(self) -> None:
        """The joints were put elsewhere: begin where they are."""
        self._begun[:] = False
        self._state[5] = 0.0

    def hold(self, joints: np.ndarray, position: np.ndarray) -> None:
        """Forget what the set-points of `joints` were: they are at position (k,) [rad]."""
        self._state[2, joints] = position

    def torques(self, wanted: ActuatorCommands, links: np.ndarray, dt: float) -> np.ndarray:
        """(n,) [Nm] what drives the links in this tick, the counterbalance among it; 0 for joints that are not driven.

        links: (3, n), their angles [rad], speeds [rad/s], and inertias about their joints, at least [kg m^2]; dt [s]. A
        joint that was not driven begins with its spring in balance with the known load and the counterbalance.
        """
        return turn(self._state, self._begun, self._numbers, wanted, links, dt)

    def counterbalance(self, position: np.ndarray) -> np.ndarray:
        """(n,) [Nm] what springs beside the actuators take off them at `position` (n,) [rad]."""
        return self.known_counterbalance(position) * (1.0 + self._numbers[_EXCESS])

    def known_counterbalance(self, position: np.ndarray) -> np.ndarray:
        """(n,) [Nm] the same as the controllers know it."""
        return self._numbers[_OFFSET] + self._numbers[_STIFFNESS] * position

    def bounded(self, torque: np.ndarray, position: np.ndarray, joints: np.ndarray) -> np.ndarray:
        """(k,) [Nm] what the motors of `joints`, with what springs beside them carry, can do of `torque` (k,) at
        position (n,) [rad]."""
        carried, limit = self.counterbalance(position)[joints], self._numbers[_LIMIT][joints]
        return np.minimum(np.maximum(torque, -limit - carried), limit - carried)

    @property
    def limit(self) -> np.ndarray:
        """(n,) [Nm] of the motors' torque."""
        return self._numbers[_LIMIT]

    @property
    def free_speed(self) -> np.ndarray:
        """(n,) [rad/s] of motors without load."""
        return FREE_SPEED * self._numbers[_SPEED]

    @property
    def hysteresis_share(self) -> np.ndarray:
        """(n,) -1 to 1, how much of its hysteresis a joint's effort has now, and in which direction."""
        return self._state[5]

    @property
    def hysteresis(self) -> np.ndarray:
        """(n,) [Nm] what hysteresis adds to the efforts that are told."""
        return self._numbers[_HYSTERESIS] * self._state[5]

    @property
    def added(self) -> np.ndarray:
        """(n,) [Nm] what the controllers asked for beside the known load in the last tick; 0 for joints that are not
        driven."""
        return self._state[6]


@_compiled
def turn(state: np.ndarray, begun: np.ndarray, numbers: np.ndarray, wanted: ActuatorCommands, links: np.ndarray,
         dt: float) -> np.ndarray:
    motor, speed, filtered, integral, last = state[0], state[1], state[2], state[3], state[4]
    torques = np.zeros(links.shape[1])
    share, added = state[5], state[6]
    part = dt / PARTS
    for j in range(links.shape[1]):
        kept = math.exp(-abs(links[1, j]) * dt / numbers[14, j])
        share[j] = kept * share[j] + math.copysign(1.0 - kept, links[1, j])
        if not wanted.driven[j]:
            begun[j], added[j] = False, 0.0
            continue
        stiffness, damping, inertia, gain, motor_damping, friction = (
            numbers[0, j], numbers[1, j], numbers[2, j], numbers[3, j], numbers[4, j], numbers[5, j])
        q, v, target, pace = links[0, j], links[1, j], wanted.position[j], wanted.velocity[j]
        known = wanted.known_load[j] + numbers[11, j] + numbers[12, j] * q
        excess = (numbers[11, j] + numbers[12, j] * q) * numbers[16, j]
        balance = numbers[11, j] + numbers[12, j] * q + excess
        if not begun[j]:
            begun[j] = True
            # It was at rest there: the integral has what the controller does not know of the counterbalance.
            integral[j] = excess
            motor[j], speed[j], filtered[j], last[j] = q + (known + excess) / stiffness, v, q, target
        lag = numbers[6, j] + (numbers[7, j] if wanted.in_position_mode[j] else 0.0)
        filtered[j] += (target - filtered[j]) * (1.0 - math.exp(-dt / lag) if lag > 0.0 else 1.0)
        reference = filtered[j] + pace * lag + (known + excess) / stiffness
        rests = abs(target - last[j]) < REST_SPEED * dt
        last[j] = target
        limit = min(numbers[10, j], wanted.effort[j])
        yields = dt * (dt * stiffness + damping) / links[2, j]
        total = 0.0
        for _ in range(PARTS):
            ahead = stiffness * (motor[j] - q - dt * v) + damping * (speed[j] - v)
            spring = (ahead + yields * (known + excess)) / (1.0 + yields)
            error = reference - motor[j]
            asked = known + gain * error + integral[j] - motor_damping * (speed[j] - pace)
            ahead_of_free = (FREE_SPEED * numbers[15, j] - abs(speed[j])) / ((FREE_SPEED - 1.0) * numbers[15, j])
            driving = limit * min(max(ahead_of_free, 0.0), 1.0)
            torque = min(max(asked, -driving if speed[j] < 0.0 else -limit), driving if speed[j] > 0.0 else limit)
            if rests and torque == asked and abs(speed[j]) < REST_SPEED and abs(error) > numbers[9, j]:
                integral[j] += numbers[8, j] * gain * error * part
            free = speed[j] + part * (torque - spring) / inertia
            # Friction takes at most all of the speed.
            braked = max(abs(free) - part * friction / inertia, 0.0)
            speed[j] = math.copysign(braked, free)
            motor[j] += part * speed[j]
            total += spring
            added[j] = asked - known
        torques[j] = total / PARTS - balance
    return torques
