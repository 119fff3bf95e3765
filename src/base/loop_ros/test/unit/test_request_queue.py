# SPDX-License-Identifier: BSD-3-Clause
"""Calls that other threads queue for the loop."""
import sys
import threading
import time

import pytest

from lab_testing.waiting import wait_until
from loop_ros.request_queue import LoopEnded, RequestQueue


@pytest.fixture
def requests():
    requests = RequestQueue()
    yield requests
    requests.close()


def serve(requests, until):
    while not until():
        requests.run_pending()
        requests.wait(0.005)


def in_thread(function):
    results = []

    def run():
        try:
            results.append(function())
        except Exception as error:  # noqa: BLE001
            results.append(error)

    thread = threading.Thread(target=run)
    thread.start()
    return thread, results


def test_a_call_runs_in_the_loop_and_returns_to_the_caller(requests):
    loop = threading.get_ident()
    thread, results = in_thread(lambda: requests.call(lambda a, b: (threading.get_ident(), a + b), 2, 3))
    serve(requests, lambda: not thread.is_alive())
    assert results == [(loop, 5)]


def test_an_error_goes_to_the_caller_and_not_into_the_loop(requests):
    thread, results = in_thread(lambda: requests.call(lambda: 1 / 0))
    serve(requests, lambda: not thread.is_alive())
    assert isinstance(results[0], ZeroDivisionError)


def test_a_request_that_exits_is_an_error_of_that_request(requests):
    thread, results = in_thread(lambda: requests.call(lambda: sys.exit(3)))
    serve(requests, lambda: not thread.is_alive())
    assert isinstance(results[0], RuntimeError) and "sys.exit(3)" in str(results[0])


def test_each_of_many_callers_gets_the_own_answer(requests):
    calls = [in_thread(lambda number=number: requests.call(lambda: number)) for number in range(30)]
    serve(requests, lambda: not any(thread.is_alive() for thread, _ in calls))
    assert [results for _, results in calls] == [[number] for number in range(30)]


def test_callers_that_still_wait_at_the_end_are_told(requests):
    thread, results = in_thread(lambda: requests.call(lambda: None))
    wait_until(lambda: requests._requests, "the request")
    requests.close()
    thread.join(60.0)
    assert isinstance(results[0], LoopEnded) and "shutting down" in str(results[0])


def test_callers_after_the_end_are_told_at_once(requests):
    requests.close()
    with pytest.raises(LoopEnded):
        requests.call(lambda: None)


def test_a_request_wakes_an_idle_loop(requests):
    threading.Timer(0.05, lambda: requests.submit(lambda: None)).start()
    start = time.monotonic()
    requests.wait(60.0)
    assert time.monotonic() - start < 50.0
    assert requests.run_pending() == 1
