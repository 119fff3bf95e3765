# SPDX-License-Identifier: BSD-3-Clause
"""When something that happens at a rate is due again, in control time."""


class Due:
    """Every ``period_s`` [s] from the first time on that it is asked."""

    def __init__(self, period_s):
        self._period_s = period_s
        self._last_s = None

    def restart(self):
        """The next time that it is asked is the first."""
        self._last_s = None

    def is_due(self, time_s):
        """Whether it is due at ``time_s``; if so, it counts as done. Time that went back begins anew."""
        if self._last_s is None or time_s < self._last_s:
            self._last_s = time_s
            return True
        # Half a nanosecond: multiples of a tick and of the period meet in rounding only.
        if self._last_s + self._period_s > time_s + 5e-10:
            return False
        self._last_s += self._period_s
        return True
