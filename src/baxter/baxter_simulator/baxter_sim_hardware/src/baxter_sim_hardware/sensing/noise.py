# SPDX-License-Identifier: BSD-3-Clause
"""Noise and counts of the sensors in the hands. Without ROS.

The noise of a moment follows from its number and the sensor's name, so it does not depend on who listens, and when.
"""

from __future__ import annotations

import zlib
from typing import TYPE_CHECKING

import numpy as np

from baxter_model import SIDES
from baxter_sim_hardware import effects
from baxter_sim_hardware.individual import difference

if TYPE_CHECKING:
    from collections.abc import Mapping

_AXES = ("x", "y", "z")


def generator(seed: int, name: str, number: int) -> np.random.Generator:
    """The random numbers of one sensor in one moment. seed, number: integers from 0."""
    return np.random.Generator(np.random.Philox(key=[seed, zlib.crc32(name.encode())], counter=[0, number, 0, 0]))


class HandSensors:
    """Readings of the hands' ranges and accelerometers.

    rows: {section: rows} of `effects.read`; serial: of the robot; seed: integer from 0. Raises HardwareError.
    """

    def __init__(self, rows: Mapping[str, Mapping[str, Mapping[str, float]]], serial: int, seed: int) -> None:
        senses = rows["senses"]
        self._seed = seed
        self._range = [effects.positive(senses, number, "hand_range")
                       for number in ("range_noise", "range_quantum", "range_period")]
        self._noise, self._quantum = (np.array([effects.positive(senses, number, axis) for axis in _AXES])
                                      for number in ("acceleration_noise", "acceleration_quantum"))
        self._turned = {side: difference(serial, "%s_accelerometer" % side, rows["serial"], "accelerometer_axes")
                        for side in SIDES}

    def begin_again(self, seed: int) -> None:
        """Go on with other noise. seed: integer from 0."""
        self._seed = seed

    def range(self, side: str, time_s: float, distance: float) -> float:
        """A hand's range [m] for a surface `distance` [m] away, at time_s [s]."""
        noise, quantum, period = self._range
        drawn = generator(self._seed, "%s range" % side, int(time_s / period + 1e-6)).standard_normal()
        return quantum * round((distance + noise * drawn) / quantum)

    def acceleration(self, side: str, tick: int, force: np.ndarray) -> np.ndarray:
        """(3,) [m/s^2] that an accelerometer says for the specific force (3,) [m/s^2] in its frame, in a tick."""
        turn = np.array([self._turned[side][axis] for axis in _AXES])
        drawn = generator(self._seed, "%s accelerometer" % side, tick).standard_normal(3)
        said = force + np.cross(force, turn) + self._noise * drawn
        return self._quantum * np.round(said / self._quantum)
