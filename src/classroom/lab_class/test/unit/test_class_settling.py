# SPDX-License-Identifier: BSD-3-Clause
"""When a lab has finished starting; processes and their demand are numbers, but for one real process."""
import subprocess
import sys

import pytest

from lab_class.settling import LIMIT_S, MAX_DEMAND, QUIET_S, Settling, demand_s
from lab_testing.waiting import wait_until

STEP_S = 0.5
SPIN = "while True: pass"


def settles_at(processes, demand, is_simulating=lambda now: True):
    """The time at which it has settled [s]; the arguments are functions of time."""
    settling, now = Settling(0.0), 0.0
    while not settling.look(processes(now), demand(now), is_simulating(now), now):
        now += STEP_S
    return now


def test_quiet_from_the_start_on():
    assert settles_at(lambda _: {1, 2}, lambda now: 0.3 * now) == QUIET_S


@pytest.mark.parametrize("processes", [
    pytest.param(lambda now: {1, 2, 3} if now < 2.0 else {1, 2}, id="one ends"),
    pytest.param(lambda now: {1} if now < 2.0 else {1, 2}, id="one starts")])
def test_not_before_the_last_process_has_come_or_gone(processes):
    assert settles_at(processes, lambda now: 0.3 * now) == 2.0 + QUIET_S


def test_not_while_its_threads_ask_for_processors():
    busy = 1.5 * MAX_DEMAND
    found = settles_at(lambda _: {1}, lambda now: busy * min(now, 10.0) + 0.1 * now)
    assert 10.0 <= found <= 10.0 + 2.0 * QUIET_S


def test_not_before_its_simulator_reports():
    found = settles_at(lambda _: {1}, lambda now: 0.0, lambda now: now >= 12.0)
    assert 12.0 <= found <= 12.0 + QUIET_S


def test_one_that_is_never_quiet_does_not_hold_up_the_others():
    assert settles_at(lambda now: {now}, lambda now: 9.0 * now) == LIMIT_S


def test_demand_grows_with_work_and_not_with_sleep():
    spinning = subprocess.Popen([sys.executable, "-c", SPIN])
    waiting = subprocess.Popen(["cat"], stdin=subprocess.PIPE, stdout=subprocess.DEVNULL)
    try:
        begun = demand_s([waiting.pid])
        wait_until(lambda: demand_s([spinning.pid]) > begun + 1.0, "a second of work")
        assert demand_s([waiting.pid]) < 0.5 * demand_s([spinning.pid])
        assert demand_s([spinning.pid, waiting.pid]) > demand_s([waiting.pid]) + 1.0
    finally:
        for program in (spinning, waiting):
            program.kill()
            program.communicate()
    assert demand_s([spinning.pid]) == 0.0
