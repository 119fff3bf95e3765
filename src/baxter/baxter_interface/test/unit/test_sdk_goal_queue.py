# SPDX-License-Identifier: BSD-3-Clause
"""The queue of goals from the action server's threads to the loop that executes them."""
import threading

import pytest

from baxter_interface.goal_queue import GoalQueue


@pytest.fixture
def queue():
    """With ``ended``, a list of (goal, text) that were never begun."""
    made = GoalQueue(lambda handle, text: made.ended.append((handle, text)))
    made.ended = []
    return made


def test_a_goal_waits_is_at_work_and_is_done(queue):
    assert queue.take(0.0) is None
    queue.put("first")
    assert queue.has_next
    assert queue.take(10.0) == "first" and not queue.has_next
    assert queue.take(0.0) is None
    queue.done()
    assert queue.ended == []


def test_the_newest_goal_takes_the_place_of_one_that_waits(queue):
    for goal in ("first", "second"):
        queue.put(goal)
    (goal, text), = queue.ended
    assert goal == "first" and "another goal" in text
    assert queue.take(10.0) == "second"


def test_a_goal_that_waits_is_cancelled_at_once_and_one_at_work_by_the_loop(queue):
    queue.put("first")
    queue.take(10.0)
    queue.put("second")
    queue.cancel("second")
    assert [goal for goal, _ in queue.ended] == ["second"] and not queue.has_next and not queue.is_cancelled
    queue.cancel("nobody's")
    assert not queue.is_cancelled
    queue.cancel("first")
    assert queue.is_cancelled and len(queue.ended) == 1
    queue.done()
    queue.put("third")
    assert queue.take(10.0) == "third" and not queue.is_cancelled


def test_a_goal_that_is_refused_leaves_all_as_it_was(queue):
    seen = []

    def refuse(is_busy):
        seen.append(is_busy)
        raise ValueError("not this one")

    queue.put("first")
    with pytest.raises(ValueError, match="not this one"):
        queue.put("second", refuse)
    assert queue.take(10.0) == "first" and queue.ended == []
    with pytest.raises(ValueError, match="not this one"):
        queue.put("third", refuse)
    queue.done()
    queue.put("fourth", seen.append)
    assert seen == [False, True, False] and queue.take(10.0) == "fourth"


@pytest.mark.parametrize(("wake", "taken"), [(lambda queue: queue.put("goal"), "goal"), (GoalQueue.close, None)])
def test_a_loop_that_waits_is_woken(queue, wake, taken):
    got = []
    thread = threading.Thread(target=lambda: got.append(queue.take(60.0)))
    thread.start()
    wake(queue)
    thread.join(90.0)
    assert got == [taken]
