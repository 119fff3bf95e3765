# SPDX-License-Identifier: BSD-3-Clause
"""Keeping simulation time in step with wall time, and measuring how well that works. ROS-free."""
from __future__ import annotations

import contextlib
import ctypes
import time
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

# A longer stall is not caught up: simulation time then stays behind [s].
MAX_DEBT_S = 1.0
# While it catches up, the world runs at most this many times as fast as requested: a short stall [s] is made up for at
# once, a longer one so that nobody sees the robot hurry.
SHORT_DEBT_S = 0.2
MAX_CATCH_UP, GENTLE_CATCH_UP = 2.0, 1.25
# The gentle speed is a mean, for which shorter delays than this do not count [s]: else a world that is held up again
# and again would fall behind by each of them.
_GENTLE_SLACK_S = 0.1
# At full speed, the loop releases the interpreter lock with this period [s, wall time].
YIELD_PERIOD_S = 0.004
# A world that is later than this [s] for so long [s, wall time], and gets no better, makes its turns longer; it tries
# shorter ones again so long [s, wall time] after that was last so.
LATE_S, LONGER_AFTER_S, SHORTER_AFTER_S = 0.05, 0.3, 30.0
# prctl(2): how late Linux may wake a sleeping thread, to wake several at once. Its default is 0.05 ms.
_PR_SET_TIMERSLACK = 29
_MIN_SLACK_NS = 1


def ticks_between(rate: float, tick_rate: float) -> int:
    """Number of ticks between two events at ``rate`` [Hz, simulation time].

    1 if the rate is above ``tick_rate`` [Hz]; rounded if the rate does not divide it. Raises ``ValueError`` for a rate
    that is not positive.
    """
    if not rate > 0.0:
        raise ValueError("the rate is %g Hz, expected a positive number, at most the tick rate of %g Hz"
                         % (rate, tick_rate))
    return max(1, round(tick_rate / rate))


def wake_on_time() -> None:
    """Make the kernel wake the calling thread on time, not up to 0.05 ms later. Does nothing on systems other than
    Linux."""
    with contextlib.suppress(AttributeError, OSError):
        ctypes.CDLL(None).prctl(_PR_SET_TIMERSLACK, _MIN_SLACK_NS, 0, 0, 0)


class Pacer:
    """Lets one tick after another happen at the right wall time.

    ``step_s`` is the simulated length of a tick [s], ``real_time_factor`` the ratio of simulated to wall time (0: as
    fast as possible). ``clock`` and ``sleep`` are replaceable for tests.
    """

    def __init__(self, step_s: float, real_time_factor: float = 1.0, clock: Callable[[], float] = time.perf_counter,
                 sleep: Callable[[float], object] = time.sleep) -> None:
        """Raises ``ValueError`` for a step that is not positive and for a negative factor."""
        if not step_s > 0.0:
            raise ValueError("the time step is %r s, expected a positive number" % (step_s,))
        if not real_time_factor >= 0.0:
            raise ValueError("real_time_factor is %r, expected 1.0 for real time, another positive number, or 0 for as "
                             "fast as possible" % (real_time_factor,))
        self.real_time_factor = real_time_factor
        self._period = step_s / real_time_factor if real_time_factor else 0.0
        self._clock = clock
        self._sleep = sleep
        self.lag = Lag(clock())
        self.restart()

    def restart(self) -> None:
        """Forget the delay: time counts from now on. For the start and after a pause."""
        # When the next tick is due, and when it may happen at the gentle speed.
        self._due = self._gentle = self._last = self._clock()
        self.lag.forget(self._last)

    def forget_lag(self) -> None:
        """Do not count the present delay as a lack of processor time."""
        self.lag.forget(self._clock())

    @property
    def is_paced(self) -> bool:
        """False where ticks follow each other as fast as possible."""
        return self._period > 0.0

    def wait(self, ticks: int = 1) -> None:
        """Sleep until the next tick is due. Called after every tick, or once after several ``ticks``."""
        now = self._clock()
        if not self._period:
            if now - self._last >= YIELD_PERIOD_S:
                self._sleep(0)
                self._last = now
            return
        self._due += ticks * self._period
        if now - self._due > MAX_DEBT_S:
            self._due = now - MAX_DEBT_S
        if self.real_time_factor <= 1.0:  # a world that should be faster than that has as much as there is
            self.lag.update(now - self._due, now)
        if now - self._due <= SHORT_DEBT_S:
            self._gentle = self._due
        else:
            self._gentle = max(self._gentle + ticks * self._period / GENTLE_CATCH_UP, now - _GENTLE_SLACK_S)
        wake = max(self._gentle, self._last + ticks * self._period / MAX_CATCH_UP)
        if wake > now:
            self._sleep(wake - now)
            now = self._clock()
        self._last = now


class Lag:
    """Whether a world has been late for long, so that its turns should be longer.

    Every turn of the loop costs something by itself: it wakes up, reads sockets, sends the time.
    """

    def __init__(self, now: float = 0.0) -> None:
        """``now`` [s, wall time]: also of the methods."""
        self.is_late = False
        self._on_time_since = self._seen_at = now
        self.forget(now)

    def forget(self, now: float) -> None:
        """After a pause or a long request: what has happened since the last turn counts neither as late nor as on
        time."""
        self._on_time_since += now - self._seen_at
        self._seen_at = now
        # Since when it is late, and how late it was then, or at the end of the last LONGER_AFTER_S.
        self._late_since, self._late_s = None, 0.0

    def update(self, late_s: float, now: float) -> None:
        """At the end of a turn that should have ended ``late_s`` ago [s]."""
        self._seen_at = now
        if late_s <= LATE_S:
            self._late_since = None
            if self.is_late and now - self._on_time_since >= SHORTER_AFTER_S:
                self.is_late = False
        elif self._late_since is None:
            self._late_since, self._late_s = now, late_s
        elif now - self._late_since >= LONGER_AFTER_S:
            if late_s >= self._late_s:
                self.is_late, self._on_time_since = True, now
            self._late_since, self._late_s = now, late_s


class RateMeter:
    """Real-time factor over consecutive windows of wall time."""

    def __init__(self, window_s: float = 1.0, clock: Callable[[], float] = time.perf_counter) -> None:
        """``window_s``: length of a window [s]."""
        self._window = window_s
        self._clock = clock
        self.restart(0.0)

    def restart(self, time_s: float) -> None:
        """Start a window at simulation time ``time_s`` [s], after a pause or a reset: a pause does not count as
        slow."""
        self._wall_start = self._clock()
        self._sim_start = time_s

    def update(self, time_s: float) -> float | None:
        """The real-time factor of the window that ends now, or None while it is still open."""
        elapsed = self._clock() - self._wall_start
        if elapsed < self._window:
            return None
        factor = (time_s - self._sim_start) / elapsed
        self.restart(time_s)
        return factor


class SlownessWatch:
    """Decides when a low real-time factor is logged: once, then at most every five minutes."""

    def __init__(self, threshold: float = 0.95, windows: int = 3, quiet_s: float = 300.0,
                 clock: Callable[[], float] = time.monotonic) -> None:
        """A window is slow below ``threshold`` times the requested factor; ``windows`` slow ones in a row are logged,
        but not within ``quiet_s`` [s, wall time] of the previous line."""
        self._threshold = threshold
        self._windows = windows
        self._quiet_s = quiet_s
        self._clock = clock
        self._slow: list[float] = []
        self._told_at: float | None = None
        self._sum, self._count = 0.0, 0

    def news(self, factor: float, wanted: float) -> tuple[float, float | None, float | None] | None:
        """Add one window's factor and the requested one. Returns (present factor, its mean since the last line, time
        since then [s]; the last two None at first), or None if there is nothing to log."""
        self._sum += factor
        self._count += 1
        if factor >= self._threshold * wanted:
            self._slow = []
            return None
        self._slow = [*self._slow, factor][-self._windows:]
        now = self._clock()
        if len(self._slow) < self._windows or (self._told_at is not None and now - self._told_at < self._quiet_s):
            return None
        mean, ago = None, None
        if self._told_at is not None:
            mean, ago = self._sum / self._count, now - self._told_at
        self._told_at, self._sum, self._count = now, 0.0, 0
        return sum(self._slow) / len(self._slow), mean, ago


def slowness_line(wanted: float, factor: float, mean: float | None, ago_s: float | None) -> str:
    """The log line about a low real-time factor; the arguments after ``wanted`` as from :meth:`SlownessWatch.news`."""
    if mean is None or ago_s is None:
        return ("the simulation runs at %.2f of real time instead of %g: this machine is too busy; close windows "
                "(gui:=false) and other programs. Said again every five minutes at most."
                % (factor, wanted))
    return ("the simulation runs at %.2f of real time instead of %g; %.2f on average in the %.0f minutes since the "
            "last such line" % (factor, wanted, mean, ago_s / 60.0))
