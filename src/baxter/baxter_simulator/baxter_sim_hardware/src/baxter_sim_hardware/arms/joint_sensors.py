# SPDX-License-Identifier: BSD-3-Clause
"""Readings of a physical arm's joints: in counts, with noise, and with the error of their sensors' gears.

A joint's controller reads the same sensor. So the error of the gear is not in what joint states say of a joint at rest:
it is the link that is elsewhere.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from baxter_sim_hardware import effects
from baxter_sim_hardware.individual import DRAWING, drawn
from baxter_sim_hardware.numbered_random import NumberedRandom
from disk_cache.compiled import compiler

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

_compiled = compiler("baxter_sim_hardware", [__file__], error_model="numpy")

QUANTITIES = ("position", "velocity", "effort")


class JointSensors:
    """The sensors of n joints.

    rows: {number: {joint: value}} as `effects.read` has them for "noise"; names: of the joints; seed: integer of the
    noise, 0 or more; serial: of the robot, from which its gears follow; robot 0 has none. Raises BaxterHardwareError.
    """

    def __init__(self, rows: Mapping[str, Mapping[str, float]], names: Sequence[str], seed: int, serial: int) -> None:
        self._quanta = [effects.per_joint(rows, "%s_quantum" % quantity, names) for quantity in QUANTITIES]
        for quantity, quantum in zip(QUANTITIES, self._quanta, strict=True):
            if quantum.min() <= 0.0:
                raise effects.BaxterHardwareError("%s_quantum is %g; it must be greater than 0" % (quantity,
                                                                                                   quantum.min()))
        self._noise = {quantity: effects.per_joint(rows, "%s_noise" % quantity, names)
                       for quantity in ("position", "effort")}
        self._gear = np.array([*(effects.per_joint(rows, number, names) for number in ("gear_error", "gear_waves")),
                               [2.0 * math.pi * drawn(serial, name, "gear").random() for name in names]])
        if serial == DRAWING:
            self._gear[0] = 0.0
        self._random = NumberedRandom(seed)

    def begin_again(self, seed: int) -> None:
        """Go on with other noise. seed: integer, 0 or more."""
        self._random.begin_again(seed)

    def felt(self, position: np.ndarray) -> np.ndarray:
        """(n,) [rad] where the sensors are, without noise, when the links are at position (n,) [rad]."""
        return position + _error(self._gear, position)

    def reached(self, felt: np.ndarray, joints: np.ndarray) -> np.ndarray:
        """(k,) [rad] where the links of `joints` are when their sensors are at felt (k,) [rad]."""
        gear = self._gear[:, joints]
        return felt - _error(gear, felt - _error(gear, felt))

    def read(self, tick: int, position: np.ndarray, velocity: np.ndarray, effort: np.ndarray) -> tuple[np.ndarray, ...]:
        """The joints' readings of this tick: the same three (n,), [rad], [rad/s] and [Nm].

        The noise of a tick follows from its number, so it does not depend on who listens, and when.
        """
        of_position, of_effort = self._random.at(tick, 0, 0).standard_normal((2, len(position)))
        position = self.felt(position) + self._noise["position"] * of_position
        effort = effort + self._noise["effort"] * of_effort
        return tuple(quantum * np.round(values / quantum)
                     for quantum, values in zip(self._quanta, (position, velocity, effort), strict=True))


@_compiled
def _error(gear: np.ndarray, position: np.ndarray) -> np.ndarray:
    """(k,) [rad] that gears add; gear: (3, k) size [rad], waves in a turn, phase [rad]; position: (k,) [rad]."""
    error = np.empty(len(position))
    for j in range(len(position)):
        error[j] = gear[0, j] * math.sin(gear[1, j] * position[j] + gear[2, j])
    return error
