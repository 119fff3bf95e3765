# SPDX-License-Identifier: BSD-3-Clause
"""When wrenches with a duration act."""
import pytest

from gazebo_ros.jobs import TimedJobs

TICK_NS = 2_000_000


def ticks_with(jobs, ticks, start_ns=0):
    """The ticks of a run in which something is due."""
    return [tick for tick in range(ticks) if jobs.due(start_ns + tick * TICK_NS)]


@pytest.mark.parametrize("duration_s, ticks", [(0.5, 250), (0.002, 1), (0.001, 1), (1e-9, 1), (0.003, 2), (0.0, 0)])
def test_a_job_lasts_as_many_ticks_as_its_duration_has(duration_s, ticks):
    jobs = TimedJobs()
    jobs.add("a", 1, 0, round(duration_s * 1e9))
    assert ticks_with(jobs, 400) == list(range(ticks))
    assert len(jobs) == 0


def test_a_negative_duration_has_no_end():
    jobs = TimedJobs()
    jobs.add("a", 1, 0, -1)
    assert len(ticks_with(jobs, 10_000)) == 10_000


def test_a_start_in_the_past_means_now():
    jobs = TimedJobs()
    jobs.add("a", 1, 1_000_000, 10 * TICK_NS)
    assert ticks_with(jobs, 100, start_ns=3_600_000_000_000) == list(range(10))


def test_a_later_start_is_waited_for_even_between_ticks():
    jobs = TimedJobs()
    jobs.add("a", 1, 5 * TICK_NS + 1, 1)
    assert ticks_with(jobs, 100) == [6]


def test_jobs_add_up_in_their_order_and_are_dropped_by_target():
    jobs = TimedJobs()
    jobs.add("a", 1, 0, -1)
    jobs.add("b", 2, 0, -1)
    jobs.add("a", 3, 0, -1)
    assert jobs.due(0) == [("a", 1), ("b", 2), ("a", 3)]
    jobs.remove(lambda target: target == "a")
    assert jobs.due(TICK_NS) == [("b", 2)]
