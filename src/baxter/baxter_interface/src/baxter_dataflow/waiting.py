# SPDX-License-Identifier: BSD-3-Clause
"""Waiting by a given clock. Free of ROS.

A clock has `now()` [s], `sleep(duration_s)` and `is_shutdown()`.
"""
from __future__ import annotations

import errno
import math
from collections.abc import Callable
from typing import Any


class Stopwatch:
    """Seconds that a clock has run since the stopwatch was made.

    A clock of a simulation reads 0 until its first tick, which may be far ahead, and goes back when the world is
    reset: neither step is time that passed, and neither is counted.
    """

    def __init__(self, now_s: float) -> None:
        self._last_s = now_s
        self._elapsed_s = 0.0

    def elapsed_s(self, now_s: float) -> float:
        """Read the stopwatch at clock reading `now_s` [s]."""
        step_s = now_s - self._last_s
        if self._last_s > 0.0 and step_s > 0.0:
            self._elapsed_s += self._counted_s(step_s)
        self._last_s = now_s
        return self._elapsed_s

    def _counted_s(self, step_s: float) -> float:
        """How much of a step between two readings counts."""
        return step_s


# A step counts at most as this many periods of the loop or usual steps; the weight of a step in the usual one.
_MAX_PERIODS, _MAX_USUAL_STEPS, _WEIGHT = 3.0, 2.0, 0.1


class LoopStopwatch(Stopwatch):
    """A Stopwatch that a loop reads once per `period_s` [s].

    A step that is much longer than the ones before counts less: a loop that is held up continues where it was. A loop
    that is always slow keeps up with the clock.
    """

    def __init__(self, now_s: float, period_s: float) -> None:
        super().__init__(now_s)
        self._period_s = self._usual_s = period_s

    def _counted_s(self, step_s: float) -> float:
        counted_s = min(step_s, max(_MAX_PERIODS * self._period_s, _MAX_USUAL_STEPS * self._usual_s))
        self._usual_s += _WEIGHT * (counted_s - self._usual_s)
        return counted_s


class Ticker:
    """A steady beat on a clock: the sleep is shortened by the time of the work between two beats."""

    def __init__(self, clock: Any, rate_hz: float) -> None:
        if not rate_hz > 0.0:
            raise ValueError("rate must be greater than 0 Hz, got %r" % (rate_hz,))
        self._clock = clock
        self._period_s = 1.0 / rate_hz
        self._next_s = clock.now() + self._period_s

    def sleep(self) -> None:
        """Sleep until the next beat. Missed beats, also after a jump of the clock, are not caught up."""
        now_s = self._clock.now()
        remaining_s = self._next_s - now_s
        if remaining_s < -self._period_s or remaining_s > self._period_s:
            remaining_s = self._period_s
            self._next_s = now_s + self._period_s
        if remaining_s > 0.0:
            self._clock.sleep(remaining_s)
        self._next_s += self._period_s


def require_timeout(timeout: Any) -> float:
    """Return a time-out [s] as a float. Raises ValueError for what is no number."""
    try:
        seconds = float(timeout)
    except (TypeError, ValueError):
        seconds = math.nan
    if math.isnan(seconds):
        raise ValueError("a time-out is a number of seconds, negative or infinite for ever; got %r" % (timeout,))
    return seconds


def is_unlimited(timeout_s: float) -> bool:
    """Tell whether a time-out means for ever: negative or infinite."""
    return timeout_s < 0.0 or math.isinf(timeout_s)


def wait_on(clock: Any, test: Callable[[], bool], timeout_s: Any, raise_on_error: bool, rate_hz: int, timeout_msg: str,
            body: Callable[[], None] | None) -> bool:
    """Wait on `clock` until `test()` is true; see `baxter_dataflow.wait_for`, which is this on ROS time."""
    timeout_s = require_timeout(timeout_s)
    watch = Stopwatch(clock.now())
    ticker = Ticker(clock, rate_hz)
    while not test():
        if clock.is_shutdown():
            return _failed(raise_on_error, errno.ESHUTDOWN, "ROS is shutting down")
        if not is_unlimited(timeout_s) and watch.elapsed_s(clock.now()) >= timeout_s:
            return _failed(raise_on_error, errno.ETIMEDOUT, timeout_msg)
        if callable(body):
            body()
        ticker.sleep()
    return True


def _failed(raise_on_error: bool, number: int, text: str) -> bool:
    if raise_on_error:
        raise OSError(number, text)
    return False
