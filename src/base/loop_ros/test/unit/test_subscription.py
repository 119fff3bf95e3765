# SPDX-License-Identifier: BSD-3-Clause
"""The queue of unread messages, and the notification of its owner."""
from types import SimpleNamespace

import pytest

from loop_ros.node_handle import NodeHandle
from loop_ros.subscription import MessageQueue


def test_without_a_depth_only_the_newest_message_counts():
    commands = MessageQueue()
    assert commands.take() is None
    commands.put("first")
    commands.put("second")
    assert commands.take() == "second"
    assert commands.take() is None
    assert commands.delivered == 2


def test_the_newest_messages_are_kept_in_order():
    commands = MessageQueue(3)
    for number in range(5):
        commands.put(number)
    assert commands.drain() == [2, 3, 4]
    assert commands.drain() == [] and commands.delivered == 5
    for number in range(3):
        commands.put(number)
    assert commands.take() == 2 and commands.drain() == []


def test_an_owner_is_told_once_which_of_its_subscriptions_have_messages():
    handle = NodeHandle(SimpleNamespace(
        subscription=lambda topic, msg_class, depth, notice: MessageQueue(depth, notice)), "/robot")
    first, second = handle.subscription("first", None, 10), handle.subscription("second", None)
    assert not handle.pending()
    second.put("a")
    second.put("b")
    assert handle.pending() == [second] and not handle.pending()
    # A message that arrives before they are read is reported again: better twice than not at all.
    first.put("c")
    assert (first.drain(), second.drain(), handle.pending()) == (["c"], ["b"], [first])
    second.put("d")
    first.put("e")
    assert handle.pending() == [first, second]
    assert not handle.branch().pending()


def test_what_counts_as_delivered_has_been_announced():
    seen = []
    commands = MessageQueue(3, lambda: seen.append((commands.delivered, list(commands._unread))))
    commands.put("a")
    assert seen == [(0, ["a"])] and commands.delivered == 1


@pytest.mark.parametrize("depth", [1, 3])
def test_the_end_of_a_subscription_is_told_once_and_drops_what_is_unread(depth):
    ends, got, commands = [], [], MessageQueue(depth)
    commands.on_close = lambda: ends.append(depth)
    commands.put("a")
    commands.close()
    commands.close()
    commands.handle(got.append)
    assert ends == [depth] and got == []


def test_a_depth_of_nothing_is_refused():
    with pytest.raises(ValueError, match="at least 1"):
        MessageQueue(0)


def test_a_message_that_cannot_be_digested_is_dropped_and_the_next_one_counts():
    faults, got = [], []

    def take(message):
        if message == "bad":
            raise RecursionError("too deep")
        if message == "worse":
            raise SystemExit(1)
        got.append(message)

    commands = MessageQueue(5, on_fault=faults.append)
    commands.handle(take)
    for message in ("first", "bad", "worse", "last"):
        commands.put(message)
    commands.handle(take)
    assert got == ["first", "last"] and [type(fault) for fault in faults] == [RecursionError, SystemExit]
    # Without on_fault they are raised.
    commands = MessageQueue()
    commands.put("bad")
    with pytest.raises(RecursionError):
        commands.handle(take)
