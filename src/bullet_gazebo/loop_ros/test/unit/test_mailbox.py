# SPDX-License-Identifier: BSD-3-Clause
"""Commands and requests on their way into the loop."""
import sys
import threading
import time
from types import SimpleNamespace

import pytest

from lab_testing.waiting import wait_until
from loop_ros.mailbox import LoopEnded, Mailbox, Queue, RequestBoard
from loop_ros.node_handle import NodeHandle


def test_only_the_newest_message_counts():
    box = Mailbox()
    assert box.take() is None
    box.put("first")
    box.put("second")
    assert box.take() == "second"
    assert box.take() is None
    assert box.delivered == 2


def test_a_queue_keeps_order_and_counts_what_it_lost():
    queue = Queue(3)
    for number in range(5):
        queue.put(number)
    assert queue.drain() == [2, 3, 4]
    assert queue.drain() == []
    assert (queue.delivered, queue.lost) == (5, 2)


def test_an_owner_is_told_once_which_of_its_queues_have_messages():
    queues = {}

    def make(topic, msg_class, depth, notice):
        return queues.setdefault(topic, Queue(depth, notice))

    ros = SimpleNamespace(queue=make)
    handle = NodeHandle(ros, "/robot")
    first, second = handle.queue("first", None, 10), handle.queue("second", None, 10)
    assert not handle.pending()
    second.put("a")
    second.put("b")
    assert handle.pending() == [second] and not handle.pending()
    # What comes in before the queues are read is told again: better twice than not at all.
    first.put("c")
    assert (first.drain(), second.drain(), handle.pending()) == (["c"], ["a", "b"], [first])
    second.put("d")
    first.put("e")
    assert handle.pending() == [first, second]
    assert not handle.branch().pending()


def test_what_counts_as_delivered_has_been_announced():
    seen = []
    queue = Queue(3, lambda: seen.append((queue.delivered, list(queue._messages))))
    queue.put("a")
    assert seen == [(0, ["a"])] and queue.delivered == 1


@pytest.mark.parametrize("box", [Mailbox(), Queue(3)])
def test_the_end_of_a_subscription_is_told_once_and_drops_what_is_unread(box):
    ends, got = [], []
    box.on_close = lambda: ends.append(box)
    box.put("a")
    box.close()
    box.close()
    box.handle(got.append)
    assert ends == [box] and got == []


def test_a_queue_without_room_is_refused():
    with pytest.raises(ValueError, match="at least 1"):
        Queue(0)


def test_a_message_that_cannot_be_digested_is_dropped_and_the_next_one_counts():
    faults, got = [], []

    def take(message):
        if message == "bad":
            raise RecursionError("too deep")
        if message == "worse":
            raise SystemExit(1)
        got.append(message)

    queue = Queue(5, on_fault=faults.append)
    for message in ("first", "bad", "worse", "last"):
        queue.put(message)
    queue.handle(take)
    assert got == ["first", "last"] and [type(fault) for fault in faults] == [RecursionError, SystemExit]
    box = Mailbox(on_fault=faults.append)
    box.handle(take)
    for message in ("bad", "newest"):
        box.put(message)
        box.handle(take)
    assert got == ["first", "last", "newest"] and len(faults) == 3
    # Who does not say what becomes of faults gets them.
    box = Mailbox()
    box.put("bad")
    with pytest.raises(RecursionError):
        box.handle(take)


@pytest.fixture
def board():
    board = RequestBoard()
    yield board
    board.close()


def serve(board, until):
    while not until():
        board.run_pending()
        board.wait(0.005)


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


def test_a_call_runs_in_the_loop_and_returns_to_the_caller(board):
    loop = threading.get_ident()
    thread, results = in_thread(lambda: board.call(lambda a, b: (threading.get_ident(), a + b), 2, 3))
    serve(board, lambda: not thread.is_alive())
    assert results == [(loop, 5)]


def test_an_error_goes_to_the_caller_and_not_into_the_loop(board):
    thread, results = in_thread(lambda: board.call(lambda: 1 / 0))
    serve(board, lambda: not thread.is_alive())
    assert isinstance(results[0], ZeroDivisionError)


def test_a_request_that_exits_is_an_error_of_that_request(board):
    thread, results = in_thread(lambda: board.call(lambda: sys.exit(3)))
    serve(board, lambda: not thread.is_alive())
    assert isinstance(results[0], RuntimeError) and "sys.exit(3)" in str(results[0])


def test_each_of_many_callers_gets_the_own_answer(board):
    calls = [in_thread(lambda number=number: board.call(lambda: number)) for number in range(30)]
    serve(board, lambda: not any(thread.is_alive() for thread, _ in calls))
    assert [results for _, results in calls] == [[number] for number in range(30)]


def test_callers_that_still_wait_at_the_end_are_told(board):
    thread, results = in_thread(lambda: board.call(lambda: None))
    wait_until(lambda: board._requests, "the request")
    board.close()
    thread.join(5.0)
    assert isinstance(results[0], LoopEnded) and "shutting down" in str(results[0])


def test_callers_after_the_end_are_told_at_once(board):
    board.close()
    with pytest.raises(LoopEnded):
        board.call(lambda: None)


def test_a_request_wakes_an_idle_loop(board):
    threading.Timer(0.05, lambda: board.submit(lambda: None)).start()
    start = time.monotonic()
    board.wait(5.0)
    assert time.monotonic() - start < 2.0
    assert board.run_pending() == 1
