# SPDX-License-Identifier: BSD-3-Clause
"""Joint positions, velocities and accelerations over time."""
from __future__ import annotations

import bisect

import numpy as np

from .errors import BeforeTrajectory
from .segment import QUINTIC, Floats, constant, splines


class Trajectory:
    """n joints over time; they rest before its start and after its end.

    Attributes
    ----------
    starts : (m,) array
        When each piece begins [s]; the last piece is constant and has no end.
    coefficients : (m, 6, n) array
        Polynomials in the time since the piece's start, see :mod:`.segment`.
    end_times : (n,) array
        When each joint has reached its last point [s].

    One thread at a time: sampling uses a work space of the object's own.
    """

    def __init__(self, starts: Floats, coefficients: Floats, end_times: Floats) -> None:
        self.starts = starts
        self.coefficients = coefficients
        self.end_times = end_times
        self._start_list: list[float] = starts.tolist()
        self._basis = np.zeros((3, 6))

    @property
    def start_time(self) -> float:
        """Start of the first piece [s]."""
        return self._start_list[0]

    @property
    def end_time(self) -> float:
        """When the last joint has reached its last point [s]."""
        return float(self.end_times.max())

    def sample(self, time_s: float, out: Floats | None = None) -> Floats:
        """(3, n): position, velocity, acceleration [rad or m, per s, per s^2] at ``time_s``; written to ``out``."""
        piece = bisect.bisect_right(self._start_list, time_s) - 1
        if piece < 0:
            out = np.zeros((3, self.coefficients.shape[2])) if out is None else out
            out[0] = self.coefficients[0, 0]
            out[1:] = 0.0
            return out
        t = time_s - self._start_list[piece]
        t2 = t * t
        t3 = t2 * t
        t4 = t2 * t2
        # Times the coefficients: position, velocity, acceleration.
        self._basis.flat[:] = (1.0, t, t2, t3, t4, t4 * t,
                            0.0, 1.0, 2.0 * t, 3.0 * t2, 4.0 * t3, 5.0 * t4,
                            0.0, 0.0, 2.0, 6.0 * t, 12.0 * t2, 20.0 * t3)
        return np.dot(self._basis, self.coefficients[piece], out)

    def query(self, time_s: float) -> Floats:
        """As :meth:`sample`, but raises :class:`BeforeTrajectory` for a time before the start."""
        if time_s < self.start_time:
            raise BeforeTrajectory(time_s, self.start_time)
        return self.sample(time_s)


def hold(time_s: float, position: Floats) -> Trajectory:
    """Stand at ``position`` (n,) from ``time_s`` on."""
    return Trajectory(np.array([time_s], dtype=float), constant(position)[None], np.full(len(position), float(time_s)))


def stop(time_s: float, position: Floats, velocity: Floats, duration_s: float) -> Trajectory:
    """Come to rest within ``duration_s`` [s] from ``position``, ``velocity`` (n,); a hold when that is 0.

    The path is the first half of a quintic that goes out and returns with the mirrored velocity: at its turning point,
    after ``duration_s``, the velocity is 0 (as in joint_trajectory_controller).
    """
    if duration_s <= 0.0:
        return hold(time_s, position)
    none = np.zeros(len(position))
    degrees = np.array([QUINTIC, QUINTIC])
    there_and_back = splines(np.array([0.0, 2.0 * duration_s]), np.array([position, position]),
                             np.array([velocity, -velocity]), np.array([none, none]), degrees)
    turning = duration_s ** np.arange(6) @ there_and_back[0]
    way = splines(np.array([0.0, duration_s]), np.array([position, turning]), np.array([velocity, none]),
                  np.array([none, none]), degrees)
    end = time_s + duration_s
    return Trajectory(np.array([time_s, end], dtype=float), np.concatenate([way, constant(turning)[None]]),
                      np.full(len(position), end))
