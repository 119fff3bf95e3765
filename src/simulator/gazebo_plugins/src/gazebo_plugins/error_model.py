# SPDX-License-Identifier: BSD-3-Clause
"""Errors of a measurement: offset, drift, noise, scale. ROS-free."""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import numpy.typing as npt

_ONE_HOUR_HZ = 1.0 / 3600.0


class ErrorModel:
    """Errors of ``size`` numbers that are measured together; each argument is one number for all, or ``size`` of them.

    :param size: how many numbers
    :param random: numpy.random.Generator
    :param offset: constant error [as the measurement]
    :param drift: standard deviation of a slow drift (Gauss-Markov process) [as the measurement]
    :param frequency: inverse of the drift's correlation time [1/s]
    :param noise: standard deviation of the white noise [as the measurement]
    :param scale: factor on the measurement
    """

    def __init__(self, size: int, random: np.random.Generator, offset: npt.ArrayLike = 0.0, drift: npt.ArrayLike = 0.0,
                 frequency: npt.ArrayLike = _ONE_HOUR_HZ, noise: npt.ArrayLike = 0.0,
                 scale: npt.ArrayLike = 1.0) -> None:
        self._random = random
        self._offset, self.drift, self._frequency, self.noise, self._scale = (
            np.broadcast_to(np.asarray(values, dtype=float), (size,))
            for values in (offset, drift, frequency, noise, scale))
        self.reset()

    def reset(self) -> None:
        """Restart the drift at a random value."""
        self._drifted = self._random.normal(0.0, 1.0, self.drift.shape) * self.drift

    @property
    def bias(self) -> np.ndarray:
        """The slow part of the error (size,): offset and drift."""
        return self._offset + self._drifted

    def add_drift(self, change: np.ndarray) -> None:
        """Add ``change`` (size,) to the drift."""
        self._drifted = self._drifted + change

    def measure(self, value: npt.ArrayLike, dt: float) -> np.ndarray:
        """The measurement (size,) of the true ``value`` (size,), ``dt`` [s] after the previous one."""
        if self.drift.any():
            # The process keeps its standard deviation for any dt: new noise replaces the decayed part.
            kept = np.exp(-dt * self._frequency)
            new = self._random.normal(0.0, 1.0, self.drift.shape) * self.drift * np.sqrt(1.0 - kept * kept)
            self._drifted = kept * self._drifted + new
        measured = np.asarray(value) * self._scale + self.bias
        if self.noise.any():
            measured = measured + self._random.normal(0.0, 1.0, self.noise.shape) * self.noise
        return measured
