# SPDX-License-Identifier: BSD-3-Clause
"""Periodic work, and time stamps of messages."""
import subprocess
import sys

import genpy
import pytest

from sim_time.pace import Pace
from sim_time.stamps import stamp, stamp_ns


def taken(pace, times_s):
    return [time_s for time_s in times_s if pace.take(time_s)]


@pytest.mark.parametrize(("rate", "tick_s", "expected"), [
    (100.0, 0.002, [0, 5, 10, 15, 20, 25]), (20.0, 0.002, [0, 25]), (500.0, 0.002, list(range(30))),
    (2000.0, 0.002, list(range(30))), (0.0, 0.002, list(range(30))),
    (300.0, 0.002, [0, 2, 4, 5, 7, 9, 10, 12, 14, 15, 17, 19, 20, 22, 24, 25, 27, 29]),  # one in 3.33 ms on average
])
@pytest.mark.parametrize("start", [0, 7 * 500, 1_000_000 * 500])
def test_a_rate_is_kept_on_average_at_ticks(rate, tick_s, expected, start):
    times = [(start + k) * tick_s for k in range(30)]
    assert taken(Pace(rate), times) == [times[k] for k in expected]


def test_who_was_late_by_many_periods_does_not_catch_up():
    pace = Pace(10.0)
    assert taken(pace, [0.0, 5.0, 5.05, 5.1]) == [0.0, 5.0, 5.1]


@pytest.mark.parametrize(("busy", "begin", "lost"), [
    (slice(6, 9), [0.0, 0.02, 0.04, 0.05, 0.09, 0.1, 0.11, 0.12, 0.14], 0),  # late by one period
    (slice(6, 10), [0.0, 0.02, 0.04, 0.05, 0.1, 0.12, 0.14], 2),
])
def test_who_was_late_loses_no_more_than_the_periods_that_have_passed(busy, begin, lost):
    # A camera of 60 Hz that sees the world at each 0.01 s, and was busy for 0.04 or 0.05 s once.
    times = [round(0.01 * k, 2) for k in range(30)]
    in_time = taken(Pace(60.0), times)
    del times[busy]
    late = taken(Pace(60.0), times)
    assert late[:len(begin)] == begin
    assert len(late) == len(in_time) - lost


def test_who_is_late_each_time_does_no_more_than_can_be_done():
    # Pictures of 60 Hz that take 0.02 s each.
    times = [round(0.02 * k, 2) for k in range(30)]
    assert taken(Pace(60.0), times) == times


def test_time_that_goes_back_restarts():
    pace = Pace(10.0)
    assert taken(pace, [5.0, 5.05, 0.02, 0.05, 0.12]) == [5.0, 0.02, 0.12]
    pace.restart()
    assert taken(pace, [0.13, 0.2, 0.23]) == [0.13, 0.23]


def test_it_is_due_until_it_was_done():
    pace = Pace(10.0)
    assert pace.is_due(0.0) and pace.is_due(0.0)
    pace.took(0.0)
    assert not pace.is_due(0.05) and pace.is_due(0.1) and pace.is_due(0.15)


def test_another_rate_counts_at_once():
    pace = Pace(1.0)
    pace.took(0.0)
    pace.rate = 10.0
    assert pace.period_s == 0.1 and taken(pace, [0.05, 0.1, 0.15]) == [0.05, 0.15]


def test_stamps_are_rounded_to_the_nanosecond():
    # 4.1 is a little less in binary; cut off, that would be 4.099999999.
    assert stamp(4.1) == genpy.Time(4, 100000000)
    assert stamp(1e-9) == genpy.Time(0, 1) and stamp(1.9999999999) == genpy.Time(2)
    assert stamp_ns(12345678901) == genpy.Time(12, 345678901)


def test_the_rule_is_free_of_ros():
    program = "import sys; sys.modules.update(dict.fromkeys(['genpy', 'rospy'])); import sim_time.pace"
    subprocess.run([sys.executable, "-c", program], check=True)
