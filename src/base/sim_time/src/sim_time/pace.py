# SPDX-License-Identifier: BSD-3-Clause
"""When periodic work is due, in simulation time. Free of ROS."""
from __future__ import annotations

import math

# Margin for the rounding of tick times and multiples of a period [s].
_TOLERANCE_S = 1e-6


class Pace:
    """Due every period after the first query; due at once when time has gone back.

    rate [Hz]: 0 means due at every query.
    """

    def __init__(self, rate: float) -> None:
        self.rate = rate

    @property
    def rate(self) -> float:
        """Rate [Hz]; 0: due at every query. Setting it restarts the period."""
        return self._rate

    @rate.setter
    def rate(self, rate: float) -> None:
        self._rate = rate
        self.period_s = 1.0 / rate if rate > 0.0 else 0.0
        self.restart()

    def restart(self) -> None:
        """Make it due at once, whatever the time."""
        self._last_s, self._next_s = -math.inf, -math.inf

    def is_due(self, time_s: float) -> bool:
        """Whether it is due at ``time_s`` [s]. It stays due until :meth:`took`."""
        return time_s >= self._next_s - _TOLERANCE_S or time_s < self._last_s

    def took(self, time_s: float) -> None:
        """Note that the work was done at ``time_s`` [s]. A caller that is late by one period makes up for it: it is due
        again at once. When more have passed, they are left out. Later periods begin when they would have begun."""
        begin = self._next_s
        if math.isinf(begin) or time_s < max(self._last_s, begin - _TOLERANCE_S):
            begin = time_s
        if self.period_s:
            passed = math.floor((time_s - begin + _TOLERANCE_S) / self.period_s)
            begin += self.period_s * (passed if passed == 1 else passed + 1)
        self._last_s, self._next_s = time_s, begin

    def take(self, time_s: float) -> bool:
        """Whether it is due at ``time_s`` [s]; if so, it counts as done."""
        # Called at every tick; nearly always nothing is due.
        if self._last_s <= time_s < self._next_s - _TOLERANCE_S:
            return False
        self.took(time_s)
        return True


class Schedule:
    """True once per period, on the period's own grid, so that rates do not drift.

    rate_hz: > 0. The first call is always due, whatever the time.
    """

    def __init__(self, rate_hz: float) -> None:
        self.set_rate(rate_hz)

    def set_rate(self, rate_hz: float) -> None:
        if not (math.isfinite(rate_hz) and rate_hz > 0.0):
            raise ValueError("rate is %s Hz; it must be greater than 0" % rate_hz)
        self.rate_hz = float(rate_hz)
        self._last: int | None = None
        self._begin_s = math.inf
        #: Nothing is due before this time [s], unless the clock goes back.
        self.next_s = -math.inf

    def due(self, time_s: float) -> bool:
        """Whether a new period has begun at time_s [s]; after the clock went back, it is due at once."""
        # Called at every tick; nearly always nothing is due.
        if self._begin_s <= time_s < self.next_s:
            return False
        period = math.floor(time_s * self.rate_hz + 1e-6)
        if period == self._last:
            return False
        self._last = period
        # Twice the margin of the line above, so that rounding never delays it.
        self._begin_s, self.next_s = period / self.rate_hz, (period + 1 - 2e-6) / self.rate_hz
        return True
