# SPDX-License-Identifier: BSD-3-Clause
from web_bridge.outgoing import OutgoingBuffer


def taken(buffer):
    found = []
    while (frames := buffer.take()) is not None:
        found.append(frames[0])
    return found


def test_entries_leave_in_the_order_of_arrival():
    buffer = OutgoingBuffer(lambda: None)
    buffer.offer(["a"])
    buffer.keep(["b"])
    buffer.offer(["c"])
    buffer.keep(["d"])
    assert taken(buffer) == ["a", "b", "c", "d"]


def test_the_oldest_message_is_dropped_and_answers_are_not():
    buffer = OutgoingBuffer(lambda: None, droppable_bytes=3)
    buffer.keep(["answer"])
    for text in "abcde":
        buffer.offer([text])
    assert taken(buffer) == ["answer", "c", "d", "e"] and buffer.dropped == 2


def test_the_newest_message_stays_whatever_its_size():
    buffer = OutgoingBuffer(lambda: None, droppable_bytes=3)
    buffer.offer(["a"])
    buffer.offer(["x" * 100])
    assert taken(buffer) == ["x" * 100]


def test_of_a_topic_with_a_limit_the_newest_stay():
    buffer = OutgoingBuffer(lambda: None)
    for text in "abc":
        buffer.offer([text], "topic", 2)
        buffer.offer([text.upper()], "other", 1)
    assert taken(buffer) == ["b", "c", "C"]


def test_answers_without_end_overflow():
    buffer = OutgoingBuffer(lambda: None, kept_bytes=10)
    for _ in range(100):
        buffer.keep(["abc"])
    assert buffer.overflowed and len(taken(buffer)) == 4


def test_it_wakes_once_until_it_was_found_empty():
    woken = []
    buffer = OutgoingBuffer(lambda: woken.append(1))
    buffer.offer(["a"])
    buffer.offer(["b"])
    assert len(woken) == 1
    assert taken(buffer) == ["a", "b"]
    buffer.keep(["c"])
    assert len(woken) == 2


def test_a_closed_buffer_holds_nothing():
    woken = []
    buffer = OutgoingBuffer(lambda: woken.append(1))
    buffer.offer(["a"], "topic", 1)
    buffer.close()
    buffer.offer(["b"])
    buffer.keep(["c"])
    assert taken(buffer) == [] and buffer.closed and woken
