# SPDX-License-Identifier: BSD-3-Clause
"""Pacing against a clock that only moves when somebody sleeps or works."""
import ctypes
from concurrent.futures import ThreadPoolExecutor

import pytest

from gazebo_ros.pacing import (
    GENTLE_CATCH_UP,
    LATE_S,
    LONGER_AFTER_S,
    MAX_CATCH_UP,
    MAX_DEBT_S,
    SHORT_DEBT_S,
    SHORTER_AFTER_S,
    YIELD_PERIOD_S,
    Lag,
    Pacer,
    RateMeter,
    SlownessWatch,
    slowness_line,
    ticks_between,
    wake_on_time,
)

PR_GET_TIMERSLACK = 30  # prctl(2)


class FakeClock:
    """Seconds that pass when told to."""

    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now

    def sleep(self, seconds):
        assert seconds >= 0.0
        self.now += seconds


@pytest.fixture
def clock():
    return FakeClock()


def test_ticks_take_their_own_length(clock):
    pacer = Pacer(0.002, clock=clock, sleep=clock.sleep)
    for _ in range(500):
        clock.now += 0.0003
        pacer.wait()
    assert clock.now == pytest.approx(101.0)


def test_ticks_that_follow_each_other_at_once_take_their_length_together(clock):
    pacer = Pacer(0.002, clock=clock, sleep=clock.sleep)
    assert pacer.is_paced and not Pacer(0.002, 0.0).is_paced
    for ticks in (1, 2, 2, 3):
        clock.now += 0.0003
        pacer.wait(ticks)
    assert clock.now == pytest.approx(100.016)
    clock.now += 0.1
    after_stall = clock.now
    for _ in range(10):
        pacer.wait(2)
    assert clock.now - after_stall == pytest.approx(9 * 0.004 / MAX_CATCH_UP)


def test_late_wakes_do_not_add_up(clock):
    pacer = Pacer(0.002, clock=clock, sleep=lambda seconds: clock.sleep(seconds + 0.0002))
    for _ in range(500):
        pacer.wait()
    assert clock.now == pytest.approx(101.0, abs=0.0003)


@pytest.mark.parametrize("factor", [0.5, 2.0, 10.0])
def test_the_factor_scales_the_period(clock, factor):
    pacer = Pacer(0.002, factor, clock=clock, sleep=clock.sleep)
    for _ in range(500):
        pacer.wait()
    assert clock.now == pytest.approx(100.0 + 1.0 / factor)


def test_a_short_stall_is_made_up_for_at_a_bounded_speed(clock):
    pacer = Pacer(0.002, clock=clock, sleep=clock.sleep)
    clock.now += 0.1
    pacer.wait()
    after_stall = clock.now
    for _ in range(10):
        pacer.wait()
    assert clock.now - after_stall == pytest.approx(10 * 0.002 / MAX_CATCH_UP)
    for _ in range(489):
        pacer.wait()
    assert clock.now == pytest.approx(101.0)


def test_a_longer_stall_is_made_up_for_gently(clock):
    pacer = Pacer(0.002, clock=clock, sleep=clock.sleep)
    clock.now += 0.9
    pacer.wait()
    begun, ticks = clock.now, 0
    while clock.now - (100.0 + 0.002 * (ticks + 1)) > SHORT_DEBT_S:
        pacer.wait()
        ticks += 1
    speed = 0.002 * ticks / (clock.now - begun)
    assert GENTLE_CATCH_UP <= speed <= 1.05 * GENTLE_CATCH_UP
    for _ in range(3000 - ticks):
        pacer.wait()
    assert clock.now == pytest.approx(100.0 + 3001 * 0.002)


@pytest.mark.parametrize(("busy_s", "every_s", "ticks"), [(0.04, 0.1, 1), (0.04, 0.1, 5), (0.04, 0.1, 10),
                                                          (0.05, 0.2, 1)])
def test_a_world_that_is_held_up_again_and_again_makes_up_for_a_stall(clock, busy_s, every_s, ticks):
    """Ticks of 2 ms that take 0.8 ms, while others have the processor for a part of the time."""
    pacer = Pacer(0.002, clock=clock, sleep=clock.sleep)
    clock.now, done = clock.now + 0.5, 0
    while done < 10000:
        clock.now += 0.0008 * ticks
        phase = (clock.now - 100.0) % every_s
        if phase < busy_s:
            clock.now += busy_s - phase
        pacer.wait(ticks)
        done += ticks
    assert clock.now - (100.0 + 0.002 * done) < 0.1


def test_a_long_stall_is_given_up(clock):
    pacer = Pacer(0.002, clock=clock, sleep=clock.sleep)
    clock.now += 10.0
    for _ in range(3000):
        pacer.wait()
    assert clock.now == pytest.approx(110.0 + 3000 * 0.002 - MAX_DEBT_S, abs=0.005)


def test_restart_forgets_what_is_owed(clock):
    pacer = Pacer(0.002, clock=clock, sleep=clock.sleep)
    clock.now += 0.15
    pacer.restart()
    pacer.wait()
    assert clock.now == pytest.approx(100.152)


def test_as_fast_as_possible_lets_others_run_now_and_then(clock):
    slept = []
    pacer = Pacer(0.002, 0.0, clock=clock, sleep=slept.append)
    for _ in range(100):
        clock.now += 0.26 * YIELD_PERIOD_S
        pacer.wait()
    assert slept == [0] * 25


class Turns:
    """Turns of 10 ms of a world with a Lag."""

    def __init__(self):
        self.now = 100.0
        self.lag = Lag(self.now)

    def late_after(self, seconds, late_s, shrinking_s=0.0):
        """Whether the world counts as late after some time in which it is behind by ``late_s``, less by ``shrinking_s``
        at each turn."""
        for _ in range(round(100 * seconds)):
            self.now += 0.01
            late_s -= shrinking_s
            self.lag.update(late_s, self.now)
        return self.lag.is_late


SOON, LATER = 0.9 * LONGER_AFTER_S, 1.2 * LONGER_AFTER_S


def test_who_is_late_for_long_and_gets_no_better_counts_as_late():
    turns = Turns()
    assert not turns.late_after(60.0, LATE_S)
    for _ in range(2):
        assert not turns.late_after(SOON, 2.0 * LATE_S)
        assert not turns.late_after(0.01, LATE_S)
    assert not turns.late_after(5.0, 100.0, 0.01), "it catches up"
    assert not turns.late_after(0.01, LATE_S)
    assert turns.late_after(LATER, 2.0 * LATE_S)
    assert turns.late_after(60.0, 2.0 * LATE_S)
    assert turns.late_after(0.9 * SHORTER_AFTER_S, 0.0)
    assert not turns.late_after(0.2 * SHORTER_AFTER_S, 0.0)


def test_pauses_and_single_hitches_do_not_keep_a_world_late():
    for pause_s, hitch_s in ((0.0, 0.06), (20.0, 0.0)):
        turns = Turns()
        assert turns.late_after(LATER, 2.0 * LATE_S)
        for _ in range(5):
            turns.late_after(0.25 * SHORTER_AFTER_S, 0.0)
            turns.late_after(0.05, hitch_s)
            turns.now += pause_s
            turns.lag.forget(turns.now)
        assert not turns.lag.is_late
    assert turns.late_after(LATER, 2.0 * LATE_S)
    turns.now += 10.0 * SHORTER_AFTER_S
    turns.lag.forget(turns.now)
    assert turns.late_after(0.9 * SHORTER_AFTER_S, 0.0), "a pause is not time in which it was on time"


def test_one_stall_does_not_make_a_world_late(clock):
    pacer = Pacer(0.002, clock=clock, sleep=clock.sleep)
    clock.now += 10.0
    for _ in range(1000):
        clock.now += 0.0005
        pacer.wait()
        assert not pacer.lag.is_late


def test_a_world_whose_turns_cost_too_much_keeps_its_time_by_longer_ones(clock):
    pacer, lengths, ticks = Pacer(0.002, clock=clock, sleep=clock.sleep), (1, 5), 0
    late = []
    while clock.now < 280.0:
        count = lengths[pacer.lag.is_late]
        clock.now += 0.003 + 0.001 * count
        pacer.wait(count)
        ticks += count
        late.append(pacer.lag.is_late)
    # It tries the shortest ones about six times, and catches up.
    assert set(late) == {True, False} and 0.002 * ticks > 0.998 * 180.0


def test_a_world_that_should_be_faster_than_the_machine_can_has_no_longer_turns(clock):
    pacer = Pacer(0.002, 5.0, clock=clock, sleep=clock.sleep)
    for _ in range(5000):
        clock.now += 0.001
        pacer.wait()
    assert not pacer.lag.is_late


@pytest.mark.parametrize("step, factor", [(0.0, 1.0), (-1.0, 1.0), (float("nan"), 1.0), (0.002, -1.0),
                                          (0.002, float("nan"))])
def test_impossible_settings_are_refused_with_what_was_found(step, factor):
    with pytest.raises(ValueError, match="expected"):
        Pacer(step, factor)


def test_the_meter_reports_once_per_window(clock):
    meter = RateMeter(1.0, clock=clock)
    factors = []
    for tick in range(1, 2001):
        clock.now += 0.004
        factor = meter.update(tick * 0.002)
        if factor is not None:
            factors.append(factor)
    assert len(factors) == 8 or len(factors) == 7
    assert factors == pytest.approx([0.5] * len(factors))


def test_what_a_window_lost_to_a_stall_at_its_edge_the_next_one_gets(clock):
    meter = RateMeter(1.0, clock=clock)
    clock.now += 0.9
    assert meter.update(0.9) is None
    clock.now += 0.15
    assert meter.update(1.0) == pytest.approx(1.0 / 1.05)
    clock.now += 0.95
    assert meter.update(2.0) is None
    clock.now += 0.05
    assert meter.update(2.05) == pytest.approx(1.05)


def test_the_meter_counts_no_time_before_a_restart(clock):
    meter = RateMeter(1.0, clock=clock)
    clock.now += 0.5
    assert meter.update(0.5) is None
    clock.now += 60.0
    meter.restart(0.0)
    clock.now += 0.75
    assert meter.update(0.75) is None
    clock.now += 0.25
    assert meter.update(1.0) == pytest.approx(1.0)


def watched(clock, factors, **settings):
    """The news of a watch, second by second: [(second, news)]."""
    watch = SlownessWatch(clock=clock, **settings)
    said = []
    for second, factor in enumerate(factors):
        clock.now += 1.0
        news = watch.news(factor, 1.0)
        if news is not None:
            said.append((second, news))
    return said


def test_a_single_slow_second_is_no_news(clock):
    assert watched(clock, [0.5, 1.0, 0.9, 0.9, 1.0]) == []


def test_lasting_slowness_is_said_once_and_every_five_minutes_with_the_figure_since(clock):
    said = watched(clock, [0.5] * 100 + [0.3] * 550)
    assert [second for second, _ in said] == [2, 302, 602]
    assert said[0][1] == (pytest.approx(0.5), None, None)
    assert said[1][1] == (pytest.approx(0.3), pytest.approx((97 * 0.5 + 203 * 0.3) / 300), pytest.approx(300.0))
    assert said[2][1] == (pytest.approx(0.3), pytest.approx(0.3), pytest.approx(300.0))


def test_slowness_that_comes_and_goes_is_not_said_more_often(clock):
    said = watched(clock, ([0.5] * 10 + [1.0] * 10) * 20)
    assert len(said) == 2 and said[1][0] - said[0][0] >= 300
    assert said[1][1][1] == pytest.approx(0.75, abs=0.02)


def test_slowness_that_is_over_is_not_said_again(clock):
    assert len(watched(clock, [0.5] * 100 + [1.0] * 1000)) == 1


def test_slowness_is_relative_to_what_was_asked_for():
    watch = SlownessWatch(windows=1)
    assert watch.news(0.5, 0.5) is None
    assert watch.news(0.9, 2.0) is not None
    assert watch.news(0.9, 0.0) is None


def test_the_lines_name_the_figures():
    assert "0.42 of real time" in slowness_line(1.0, 0.42, None, None)
    line = slowness_line(1.0, 0.42, 0.61, 310.0)
    assert "0.42" in line and "0.61 on average" in line and "5 minutes" in line


@pytest.mark.parametrize(("rate", "tick_rate", "ticks"), [
    (500.0, 500.0, 1), (100.0, 500.0, 5), (500.0, 1000.0, 2), (500.0, 100.0, 1), (500.0, 1.0 / 0.003, 1),
    (100.0, 1.0 / 0.003, 3)])
def test_a_rate_is_as_near_as_ticks_come(rate, tick_rate, ticks):
    assert ticks_between(rate, tick_rate) == ticks


@pytest.mark.parametrize("rate", [0.0, -1.0, float("nan")])
def test_a_rate_that_is_not_positive_is_refused(rate):
    with pytest.raises(ValueError, match="expected a positive number, at most the tick rate of 500 Hz"):
        ticks_between(rate, 500.0)


def test_the_kernel_wakes_the_thread_that_asked_on_time_and_no_other():
    def slack_ns(prepare):
        prepare()
        return ctypes.CDLL(None).prctl(PR_GET_TIMERSLACK, 0, 0, 0, 0)

    with ThreadPoolExecutor(1) as one, ThreadPoolExecutor(1) as other:
        assert one.submit(slack_ns, wake_on_time).result() == 1
        assert other.submit(slack_ns, lambda: None).result() > 1
