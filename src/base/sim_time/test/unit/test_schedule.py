# SPDX-License-Identifier: BSD-3-Clause
"""A schedule is due once per period, on the period's grid, whatever the ticks."""
import math
from fractions import Fraction

import pytest

from sim_time.pace import Schedule


def due_at(schedule, times_s):
    return [time_s for time_s in times_s if schedule.due(time_s)]


@pytest.mark.parametrize("hz", [1.0, 20.0, 33.0, 100.0, 333.0, 500.0])
@pytest.mark.parametrize("tick_s", ["1/500", "1/1000", "1/240"])
@pytest.mark.parametrize("start_s", [0, 7, 1_000_000])
def test_once_per_period_at_the_first_tick_in_it(hz, tick_s, start_s):
    """Times are fractions, which do not round."""
    ticks = [start_s + k * Fraction(tick_s) for k in range(2500)]
    expected = [tick for k, tick in enumerate(ticks)
                if k == 0 or math.floor(tick * Fraction(hz)) != math.floor(ticks[k - 1] * Fraction(hz))]
    assert due_at(Schedule(hz), map(float, ticks)) == [float(tick) for tick in expected]


def test_ticks_longer_than_a_period_are_all_due():
    ticks = [0.05 * k for k in range(40)]
    assert due_at(Schedule(100.0), ticks) == ticks


def test_the_first_call_is_due_and_another_at_the_same_time_is_not():
    schedule = Schedule(10.0)
    assert due_at(schedule, [0.037, 0.037, 0.099]) == [0.037]
    assert schedule.due(0.1)


def test_a_time_that_rounding_put_just_before_the_period_counts_to_it():
    schedule = Schedule(10.0)
    times = [math.nextafter(k / 10.0, 0.0) for k in range(1, 50)]
    assert due_at(schedule, times) == times


@pytest.mark.parametrize("tick_s", [0.001, 0.002, 0.01 / 3])
@pytest.mark.parametrize("rate_hz", [1, 5, 50, 60, 99.9, 100, 500, 1000])
def test_nothing_is_due_before_the_time_that_a_schedule_tells(rate_hz, tick_s):
    asked, told = Schedule(rate_hz), Schedule(rate_hz)
    assert told.next_s < 0.0
    for tick in range(3000):
        now = tick * tick_s
        due = asked.due(now)
        assert not due or now >= told.next_s
        if now >= told.next_s:
            assert told.due(now) == due


def test_a_clock_that_went_back_restarts():
    schedule = Schedule(10.0)
    assert due_at(schedule, [5.0, 5.1, 0.0, 0.05, 0.1, 0.15]) == [5.0, 5.1, 0.0, 0.1]


def test_another_rate_restarts():
    schedule = Schedule(1.0)
    assert due_at(schedule, [3.0, 3.5]) == [3.0]
    schedule.set_rate(10.0)
    assert schedule.rate_hz == 10.0
    assert schedule.next_s < 3.0
    assert due_at(schedule, [3.55, 3.56, 3.6]) == [3.55, 3.6]


@pytest.mark.parametrize("hz", [0.0, -1.0, math.nan, math.inf])
def test_impossible_rates_are_refused(hz):
    with pytest.raises(ValueError, match="greater than 0"):
        Schedule(hz)
