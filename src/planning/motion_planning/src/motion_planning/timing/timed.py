# SPDX-License-Identifier: BSD-3-Clause
"""A trajectory of joints as points, and what controllers make of it between them."""
from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from joint_trajectory.segment import QUINTIC, splines

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

# Where within a segment peaks are looked for, and how far below a limit they are kept for what lies between.
_INSIDE = np.linspace(0.0, 1.0, 33)
_BELOW = 0.998


@dataclass(frozen=True)
class Timed:
    """times (m,) [s] from 0 on, strictly increasing; positions, velocities, accelerations (m, k)."""

    times: np.ndarray
    positions: np.ndarray
    velocities: np.ndarray
    accelerations: np.ndarray

    @property
    def duration(self) -> float:
        """[s]"""
        return float(self.times[-1])

    def stretched(self, factor: float) -> Timed:
        """The same motion, ``factor`` times as long."""
        return Timed(self.times * factor, self.positions, self.velocities / factor, self.accelerations / factor**2)

    def sampled(self, times: ArrayLike) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Positions, velocities, accelerations (n, k) at ``times`` (n,) [s]; held before the start and after the end.

        Quintic between the points, as controllers play it.
        """
        times = np.clip(np.asarray(times, dtype=float), 0.0, self.times[-1])
        if len(self.times) == 1:
            rest = np.zeros((len(times), self.positions.shape[1]))
            return rest + self.positions, rest, rest
        segment = np.clip(np.searchsorted(self.times, times, side="right") - 1, 0, len(self.times) - 2)
        return _evaluated(self._polynomials[segment], (times - self.times[segment])[:, None])

    def peaks(self) -> tuple[np.ndarray, np.ndarray]:
        """The greatest speed and acceleration (m - 1, k) within each segment."""
        polynomials, durations = self._polynomials, np.diff(self.times)
        time = (durations[:, None] * _INSIDE)[:, :, None]
        _, velocity, acceleration = _evaluated(polynomials[:, None], time)
        return np.abs(velocity).max(axis=1), np.abs(acceleration).max(axis=1)

    def spaced(self, step: float) -> np.ndarray:
        """Times (n,) [s] between which no joint moves by more than ``step`` [rad or m], those of the points among
        them."""
        if len(self.times) == 1:
            return self.times
        speeds, _ = self.peaks()
        counts = np.maximum(1, np.ceil(speeds.max(axis=1) * np.diff(self.times) / step)).astype(int)
        step_s = np.repeat(np.diff(self.times) / counts, counts)
        number = np.arange(len(step_s)) - np.repeat(np.cumsum(counts) - counts, counts)
        return np.append(np.repeat(self.times[:-1], counts) + number * step_s, self.times[-1])

    @functools.cached_property
    def _polynomials(self) -> np.ndarray:
        return splines(self.times, self.positions, self.velocities, self.accelerations,
                       np.full(len(self.times), QUINTIC))


def within_limits(timed: Timed, velocity: np.ndarray, acceleration: np.ndarray) -> Timed:
    """Return ``timed``, stretched if it has to be, with every limit (k,) kept between the points too."""
    if len(timed.times) == 1:
        return timed
    speeds, accelerations = timed.peaks()
    excess = max((speeds / velocity).max(), np.sqrt((accelerations / acceleration).max())) / _BELOW
    return timed if excess <= 1.0 else timed.stretched(excess)


def _evaluated(polynomials: np.ndarray, time: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Polynomials (..., 6, k) and two derivatives at ``time`` (..., 1) since their start."""
    c0, c1, c2, c3, c4, c5 = (polynomials[..., i, :] for i in range(6))
    position = c0 + time * (c1 + time * (c2 + time * (c3 + time * (c4 + time * c5))))
    velocity = c1 + time * (2.0 * c2 + time * (3.0 * c3 + time * (4.0 * c4 + time * 5.0 * c5)))
    acceleration = 2.0 * c2 + time * (6.0 * c3 + time * (12.0 * c4 + time * 20.0 * c5))
    return position, velocity, acceleration
