# SPDX-License-Identifier: BSD-3-Clause
"""A loop goes on after errors that nobody foresaw, until its end."""
import threading
from types import SimpleNamespace

from lab_testing.waiting import wait_until
from lab_web.loops import attended, lasting
from loop_ros.faults import Faults


def run(loop, ends):
    log = []
    lasting(Faults(SimpleNamespace(error=log.append)), "the hands", loop, retry_s=0.0)(ends)
    return log


def test_a_loop_goes_on_after_errors_and_logs_them_once_in_a_while():
    left = [OverflowError("too large"), SystemExit(1), ValueError("again")]

    def loop(ends):
        while left:
            raise left.pop(0)
        ended.set()
    ended = threading.Event()
    log = run(loop, ended.is_set)
    assert ended.is_set() and left == []
    assert len(log) == 1 and log[0].startswith("the hands: OverflowError: too large")


def test_a_loop_that_fails_at_its_end_ends():
    ended = threading.Event()

    def loop(ends):
        ended.set()
        raise KeyError("gone")
    assert "KeyError" in run(loop, ended.is_set)[0]


def test_a_loop_runs_while_there_is_a_page_and_ends_in_either_case():
    present, ended, rounds, running = threading.Event(), threading.Event(), [], threading.Event()

    def loop(ends):
        rounds.append(len(rounds))
        running.set()
        wait_until(ends, "the loop's end")
        running.clear()

    thread = threading.Thread(target=attended(present, loop), args=(ended.is_set,))
    thread.start()
    for number in range(2):
        present.set()
        wait_until(running.is_set, "the loop to run")
        present.clear()
        wait_until(lambda: not running.is_set(), "the loop to end")
        assert rounds == list(range(number + 1))
    present.set()
    wait_until(running.is_set, "the loop to run")
    ended.set()
    thread.join(60.0)
    assert not thread.is_alive() and len(rounds) == 3
