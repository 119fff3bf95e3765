# SPDX-License-Identifier: BSD-3-Clause
"""Waiting, on clocks made for it."""
import errno
import math

import numpy as np
import pytest

from baxter_dataflow.waiting import LoopStopwatch, Stopwatch, Ticker, wait_on
from baxter_interface.waiting import Condition, wait_in_order


class FakeClock:
    """A clock that a sleep advances, with simulated faults."""

    def __init__(self, now_s=100.0):
        self.now_s = now_s
        self.slept_s = 0.0
        self.shutdown_at_s = math.inf

    def now(self):
        return self.now_s

    def sleep(self, duration_s):
        assert duration_s > 0.0
        self.now_s += duration_s
        self.slept_s += duration_s

    def is_shutdown(self):
        return self.now_s >= self.shutdown_at_s


def wait(clock, test, timeout_s=1.0, raise_on_error=True, body=None):
    return wait_on(clock, test, timeout_s, raise_on_error, 100, "no such luck", body)


def test_condition_that_holds_runs_no_body_and_takes_no_time():
    clock = FakeClock()
    assert wait(clock, lambda: True, body=lambda: pytest.fail("body was called"))
    assert clock.slept_s == 0.0


def test_body_runs_after_each_failed_test():
    clock, log = FakeClock(), []
    assert wait(clock, lambda: log.append("test") or log.count("test") == 3, body=lambda: log.append("body"))
    assert log == ["test", "body", "test", "body", "test"]


def test_time_out_raises_with_the_given_text():
    clock = FakeClock()
    with pytest.raises(OSError, match="no such luck") as caught:
        wait(clock, lambda: False)
    assert caught.value.errno == errno.ETIMEDOUT
    assert clock.slept_s == pytest.approx(1.0, abs=0.011)


def test_time_out_may_be_a_return_value():
    assert wait(FakeClock(), lambda: False, raise_on_error=False) is False


@pytest.mark.parametrize("timeout_s", [-1.0, math.inf])
def test_no_time_limit_waits_until_shutdown(timeout_s):
    clock = FakeClock()
    clock.shutdown_at_s = 500.0
    with pytest.raises(OSError) as caught:
        wait(clock, lambda: False, timeout_s)
    assert caught.value.errno == errno.ESHUTDOWN


@pytest.mark.parametrize("timeout_s", [math.nan, None, "soon"])
def test_a_time_out_that_is_no_number_is_refused(timeout_s):
    with pytest.raises(ValueError, match="a time-out is a number of seconds"):
        wait(FakeClock(), lambda: False, timeout_s)


def test_first_tick_of_a_simulated_clock_is_no_time_passed():
    watch = Stopwatch(0.0)
    assert watch.elapsed_s(0.0) == 0.0
    assert watch.elapsed_s(5000.0) == 0.0
    assert watch.elapsed_s(5000.5) == 0.5


def test_clock_that_jumps_back_loses_no_time_and_gains_none():
    watch = Stopwatch(50.0)
    assert watch.elapsed_s(51.0) == 1.0
    assert watch.elapsed_s(0.5) == 1.0
    assert watch.elapsed_s(0.75) == 1.25


def test_loop_that_is_held_up_continues_where_it_was():
    watch = LoopStopwatch(50.0, 0.01)
    assert watch.elapsed_s(50.01) == pytest.approx(0.01)
    assert watch.elapsed_s(50.51) == pytest.approx(0.04)
    assert watch.elapsed_s(50.52) == pytest.approx(0.05)


def test_loop_that_is_always_slow_keeps_up():
    watch = LoopStopwatch(50.0, 0.01)
    times = 50.0 + 0.08 * np.arange(1, 101)
    readings = np.diff([watch.elapsed_s(now_s) for now_s in times])
    assert readings[0] == pytest.approx(0.03)
    assert readings[60:] == pytest.approx(0.08)


@pytest.mark.parametrize("jump_s", [-90.0, 900.0])
def test_ticker_keeps_its_beat_after_a_jump(jump_s):
    clock = FakeClock()
    ticker = Ticker(clock, 100.0)
    ticker.sleep()
    clock.now_s += jump_s
    before_s = clock.slept_s
    for _ in range(10):
        ticker.sleep()
    assert clock.slept_s - before_s == pytest.approx(0.1)


def test_ticker_takes_the_work_off_the_sleep():
    clock = FakeClock()
    ticker = Ticker(clock, 100.0)
    for _ in range(10):
        clock.now_s += 0.004
        ticker.sleep()
    assert clock.now_s == pytest.approx(100.1)


def test_ticker_refuses_a_rate_of_nothing():
    with pytest.raises(ValueError, match="greater than 0"):
        Ticker(FakeClock(), 0.0)


class FakeLine:
    def __init__(self):
        self.shown, self.ended, self.notes = [], 0, []

    def say(self, what, waited_s):
        if what not in self.shown:
            self.shown.append(what)

    def note(self, text):
        self.notes.append(text)

    def end(self):
        self.ended += 1


def patient(clock, conditions, line=None, timeout_s=30.0, is_coming=lambda: False):
    wait_in_order(conditions, timeout_s, line or FakeLine(), is_coming, clock.is_shutdown, clock.now, clock.sleep)


def test_conditions_met_pass_without_a_word():
    clock, line = FakeClock(), FakeLine()
    patient(clock, [Condition("it", lambda: True, str)] * 3, line)
    assert line.shown == [] and clock.slept_s == 0.0


def test_wait_shows_what_it_waits_for_and_takes_the_line_away():
    clock, line = FakeClock(), FakeLine()
    conditions = [Condition("a master", lambda: clock.slept_s > 10.0, str),
                  Condition("a robot", lambda: clock.slept_s > 20.0, str)]
    patient(clock, conditions, line)
    assert line.shown == ["a master", "a robot"] and line.ended == 1


def test_vain_wait_says_what_was_found_and_all_conditions_share_the_time():
    clock, line = FakeClock(), FakeLine()
    conditions = [Condition("a master", lambda: clock.slept_s > 20.0, str),
                  Condition("a robot", lambda: False, lambda: "found a toaster")]
    with pytest.raises(OSError, match="waited 30 s for a robot: found a toaster") as caught:
        patient(clock, conditions, line)
    assert caught.value.errno == errno.ETIMEDOUT
    assert clock.slept_s == pytest.approx(30.0, abs=0.06)
    assert line.ended == 1


def test_a_long_wait_says_why_long_before_it_ends():
    clock, line = FakeClock(), FakeLine()
    patient(clock, [Condition("time", lambda: clock.slept_s > 8.0, lambda: "paused at %.0f s" % clock.slept_s)], line)
    assert line.notes == ["still waiting for time: paused at 5 s"]


def test_what_is_on_its_way_is_no_reason():
    clock, line = FakeClock(), FakeLine()
    patient(clock, [Condition("a robot", lambda: clock.slept_s > 20.0, str)], line, is_coming=lambda: True)
    assert line.notes == []


def test_the_time_limit_does_not_run_while_what_is_waited_for_is_on_its_way():
    clock = FakeClock()
    patient(clock, [Condition("a robot", lambda: clock.slept_s > 200.0, str)],
            is_coming=lambda: clock.slept_s < 180.0)
    clock = FakeClock()
    with pytest.raises(OSError, match="waited 130 s for a robot"):
        patient(clock, [Condition("a robot", lambda: False, str)], is_coming=lambda: clock.slept_s < 100.5)


def test_what_dies_on_its_way_ends_the_wait():
    clock = FakeClock()

    def is_coming():
        if clock.slept_s > 5.0:
            raise OSError("the simulator is gone")
        return True

    with pytest.raises(OSError, match="the simulator is gone"):
        patient(clock, [Condition("a robot", lambda: False, str)], is_coming=is_coming)
    assert clock.slept_s < 7.0


def test_shutdown_ends_the_wait():
    clock = FakeClock()
    clock.shutdown_at_s = 103.0
    with pytest.raises(OSError, match="shutting down") as caught:
        patient(clock, [Condition("a master", lambda: False, str)])
    assert caught.value.errno == errno.ESHUTDOWN
