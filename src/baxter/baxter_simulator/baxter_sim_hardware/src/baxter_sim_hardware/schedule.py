# SPDX-License-Identifier: BSD-3-Clause
"""When something that happens at a rate is due, in simulation time."""
import math


class Schedule:
    """True once per period, on the period's own grid, so that rates do not drift.

    rate_hz: > 0. The first call is always due, whatever the time.
    """

    def __init__(self, rate_hz):
        self.set_rate(rate_hz)

    def set_rate(self, rate_hz):
        if not (math.isfinite(rate_hz) and rate_hz > 0.0):
            raise ValueError("rate is %s Hz; it must be greater than 0" % rate_hz)
        self.rate_hz = float(rate_hz)
        self._last = None
        self._begin_s = math.inf
        #: Until when nothing is due [s], if the clock does not go back.
        self.next_s = -math.inf

    def due(self, time_s):
        """Whether a new period has begun at time_s [s]; a clock that went back begins anew."""
        # Asked at every tick, and nearly always in vain.
        if self._begin_s <= time_s < self.next_s:
            return False
        period = math.floor(time_s * self.rate_hz + 1e-6)
        if period == self._last:
            return False
        self._last = period
        # Twice the margin of the line above, so that rounding cannot make it late.
        self._begin_s, self.next_s = period / self.rate_hz, (period + 1 - 2e-6) / self.rate_hz
        return True
