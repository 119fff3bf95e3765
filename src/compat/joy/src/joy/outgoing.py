# SPDX-License-Identifier: BSD-3-Clause
"""When a message about a joystick is due."""
from __future__ import annotations

import math


class Outgoing:
    """Times are [s] of any one clock.

    coalesce_s: how long a message waits for other sticks to move too [s], 0 to 1; repeat_hz: how often the last one is
    sent again [Hz], 0 (never) to 1000. Raises ValueError for values out of range.
    """

    def __init__(self, coalesce_s: float = 0.001, repeat_hz: float = 0.0) -> None:
        if not 0.0 <= coalesce_s <= 1.0:
            raise ValueError("coalesce_interval is %s; it must be from 0 to 1 s" % coalesce_s)
        if not 0.0 <= repeat_hz <= 1000.0:
            raise ValueError("autorepeat_rate is %s; it must be from 0 to 1000 Hz" % repeat_hz)
        self._coalesce_s = coalesce_s
        self._period_s = 1.0 / repeat_hz if repeat_hz else math.inf
        self._due_s = math.inf

    def changed(self, now_s: float, at_once: bool) -> None:
        """Note a change; at_once: it was a button, which does not wait."""
        self._due_s = min(self._due_s, now_s + (0.0 if at_once else self._coalesce_s))

    def is_due(self, now_s: float) -> bool:
        return now_s >= self._due_s

    def wait_s(self, now_s: float) -> float:
        """Until the next message is due [s]; infinite when none is."""
        return max(0.0, self._due_s - now_s)

    def sent(self, now_s: float) -> None:
        """Note that a message was sent."""
        self._due_s = now_s + self._period_s

    def cancel(self) -> None:
        """Stop repeating: the joystick is gone."""
        self._due_s = math.inf
