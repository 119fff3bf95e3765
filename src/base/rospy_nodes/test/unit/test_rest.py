# SPDX-License-Identifier: BSD-3-Clause
"""Topics that are subscribed to on demand."""
import threading

import pytest

from rospy_nodes.rest import Demand

LINGER_S = 5.0


class Lab:
    """A Demand on a clock of its own."""

    def __init__(self):
        self.now, self.needed, self.calls, self._timers = 100.0, False, [], []
        self.fails = self.does_not_know = False
        self.demand = Demand(self._listen, lambda: self.calls.append("rest"), LINGER_S, self._is_needed,
                             lambda: self.now, self._timer)

    def _is_needed(self):
        if self.does_not_know:
            raise KeyError("a page that has gone")
        return self.needed

    def _listen(self):
        if self.fails:
            raise OSError("no master")
        self.calls.append("listen")

    def _timer(self, seconds, function):
        lab, due = self, self.now + seconds

        class Timer:
            def start(self):
                lab._timers.append((due, function))

        return Timer()

    def run(self, seconds):
        end = self.now + seconds
        while due := [timer for timer in self._timers if timer[0] <= end]:
            first = min(due, key=lambda timer: timer[0])
            self._timers.remove(first)
            self.now = first[0]
            first[1]()
        self.now = end
        return self.calls


@pytest.fixture
def lab():
    return Lab()


def test_nobody_needs_it_at_first(lab):
    assert lab.run(1000.0) == []


def test_it_listens_from_the_first_need_until_some_time_after_the_last(lab):
    for _ in range(4):
        lab.demand.need()
        assert lab.run(0.9 * LINGER_S) == ["listen"]
    assert lab.run(0.2 * LINGER_S) == ["listen", "rest"]
    assert lab.run(1000.0) == ["listen", "rest"]
    lab.demand.need()
    assert lab.calls == ["listen", "rest", "listen"]


def test_it_does_not_rest_while_it_is_needed(lab):
    lab.needed = True
    lab.demand.need()
    assert lab.run(1000.0) == ["listen"]
    lab.needed = False
    # Also not at once: a page is loaded again.
    assert lab.run(LINGER_S - 1.5) == ["listen"]
    lab.needed = True
    assert lab.run(1.5) == ["listen"]
    lab.needed = False
    assert lab.run(2.0 * LINGER_S) == ["listen", "rest"]


def test_a_failure_is_told_and_the_next_need_tries_again(lab):
    lab.fails = True
    with pytest.raises(OSError, match="no master"):
        lab.demand.need()
    lab.fails = False
    lab.demand.need()
    assert lab.run(LINGER_S) == ["listen", "rest"]


def test_threads_that_need_it_at_once_find_it_listening():
    calls, ready = [], threading.Barrier(8)
    demand = Demand(lambda: calls.append("listen"), lambda: calls.append("rest"), 1000.0)
    found = []

    def need():
        ready.wait(60.0)
        demand.need()
        found.append(list(calls))

    threads = [threading.Thread(target=need) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60.0)
    assert found == [["listen"]] * 8


def test_it_rests_by_itself():
    rested = threading.Event()
    Demand(lambda: None, rested.set, 0.02).need()
    assert rested.wait(60.0)


def test_who_needs_it_is_asked_again_after_an_error(lab):
    lab.demand.need()
    lab.does_not_know = True
    with pytest.raises(KeyError, match="a page that has gone"):
        lab.run(LINGER_S)
    lab.does_not_know = False
    assert lab.run(2 * LINGER_S) == ["listen", "rest"]
