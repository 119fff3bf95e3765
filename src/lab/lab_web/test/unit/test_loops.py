# SPDX-License-Identifier: BSD-3-Clause
"""A loop runs while there is a page, until its end."""
import threading

from lab_testing.waiting import wait_until
from lab_web.loops import attended


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
