# SPDX-License-Identifier: BSD-3-Clause
"""Clients that misbehave, of any protocol. ``check()`` sees that another client still gets its messages."""
import os
import threading

import pytest
import websocket

from lab_testing.waiting import wait_until
from web_bridge.websocket import _THREADS as POOL_THREADS

foreign_pages = pytest.mark.parametrize("options", [
    {"origin": "http://evil.example"}, {"origin": "null"}, {"host": "evil.example", "origin": "http://evil.example"}],
    ids=["foreign", "none", "rebound"])


def check_refuses_foreign_pages(lab, options):
    with pytest.raises(websocket.WebSocketBadStatusException, match="403"):
        lab.connect(**options)
    lab.connect(origin="http://localhost:8000").echo()


def check_visits_leave_nothing(lab, visit, are_gone, check):
    """Fifty visits, five at a time; ``are_gone()``: nothing of them is left in the graph. The lab has one client."""
    visit()
    wait_until(lambda: len(lab.clients) == 1, "the first to go")
    before = _threads_and_descriptors()
    for _ in range(10):
        visitors = [threading.Thread(target=visit) for _ in range(5)]
        for visitor in visitors:
            visitor.start()
        for visitor in visitors:
            visitor.join(90)
        check()
    lab.forget_all_but_the_first()
    wait_until(lambda: len(lab.clients) == 1 and are_gone(), "all to be gone")

    def is_as_before():
        now = _threads_and_descriptors()
        # The pool's threads, up to its limit, are started when first needed.
        return now[0] <= before[0] + POOL_THREADS and now[1] <= before[1] + 2
    wait_until(is_as_before, lambda: "threads and descriptors: %s then, %s now" % (before, _threads_and_descriptors()))


def check_loses_old_messages(lab, send, check, next_number):
    """Send sixty messages of 500 kB to a client that does not read, with a buffer of 2 MB; ``send(text)``;
    ``next_number()``: that of the next one that it reads, when it reads again.
    """
    block = "x" * 500_000
    for number in range(60):
        send("%02d:%s" % (number, block))
        check()
    buffers = [socket._session.outgoing for socket in list(lab.clients._open)]
    assert sum(buffer.dropped for buffer in buffers) > 20
    assert max(sum(buffer._sizes) for buffer in buffers) <= 2_000_000
    # It wakes up: the newest is there.
    numbers = []
    while not numbers or numbers[-1] != 59:
        numbers.append(next_number())
    assert numbers == sorted(numbers) and len(numbers) < 40


def _threads_and_descriptors():
    return threading.active_count(), len(os.listdir("/proc/self/fd"))
