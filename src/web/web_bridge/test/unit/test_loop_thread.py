# SPDX-License-Identifier: BSD-3-Clause
import threading

import pytest

from lab_testing.waiting import wait_until
from web_bridge.loop_thread import LoopThread


@pytest.fixture
def loop():
    loop = LoopThread("test")
    yield loop
    loop.stop()


def test_calls_come_in_their_order_and_wake_the_loop_once(loop, monkeypatch):
    woken, done, go_on = [], [], threading.Event()
    wake = loop.loop.call_soon_threadsafe
    loop.soon(go_on.wait)
    monkeypatch.setattr(loop.loop, "call_soon_threadsafe", lambda *call: woken.append(call) or wake(*call))
    for number in range(10):
        loop.soon(done.append, number)
    go_on.set()
    wait_until(lambda: len(done) == 10, "all calls")
    assert done == list(range(10)) and len(woken) <= 2
    # The loop is woken up again for what comes later.
    loop.soon(done.append, 10)
    wait_until(lambda: done[-1] == 10, "a later call")


def test_a_call_that_fails_takes_no_other_along(loop):
    done, said = [], []
    loop.loop.set_exception_handler(lambda _loop, context: said.append(context["exception"]))
    loop.soon(int, "x")
    loop.soon(done.append, 1)
    wait_until(lambda: done == [1] and [type(error) for error in said] == [ValueError], "the call after one that fails")


def test_a_loop_that_has_ended_is_asked_for_nothing():
    loop, done = LoopThread("test"), []
    loop.stop()
    wait_until(loop.loop.is_closed, "the loop's end")
    for number in range(3):
        loop.soon(done.append, number)
    assert done == []
