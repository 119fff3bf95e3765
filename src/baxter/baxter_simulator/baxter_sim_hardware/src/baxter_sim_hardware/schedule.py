# SPDX-License-Identifier: BSD-3-Clause
"""When something that happens at a rate is due, in simulation time."""
import math


class Schedule:
    """True once per period, on the period's own grid, so that rates do not drift.

    rate_hz: > 0. The first call is always due, whatever the time.
    """

    def __init__(self, rate_hz):
        self._last = None
        self.set_rate(rate_hz)

    def set_rate(self, rate_hz):
        if not (math.isfinite(rate_hz) and rate_hz > 0.0):
            raise ValueError("rate is %s Hz; it must be greater than 0" % rate_hz)
        self.rate_hz = float(rate_hz)
        self._last = None

    @property
    def next_s(self):
        """Until when nothing is due [s], if the clock does not go back."""
        # Twice the margin of `due`, so that rounding cannot make it late.
        return -math.inf if self._last is None else (self._last + 1 - 2e-6) / self.rate_hz

    def due(self, time_s):
        """Whether a new period has begun at time_s [s]; a clock that went back begins anew."""
        period = math.floor(time_s * self.rate_hz + 1e-6)
        if period == self._last:
            return False
        self._last = period
        return True
