# SPDX-License-Identifier: BSD-3-Clause
"""Waits with a deadline: the only place where tests use wall time."""
import os
import threading
import time

POLL_S = 0.01
# Only keeps a test from hanging: so long that no busy machine fails it.
DEADLINE_S = 90.0
# `./baxter.sh test` sets the factor of the time limits; with `--busy` it gives the tests a part of one core.
STRETCH = float(os.environ.get("LAB_TEST_STRETCH", "1"))


def stretched(seconds):
    """``seconds`` times STRETCH, for time-outs of rospy, subprocess and the like."""
    return seconds * STRETCH


def wait_until(condition, what="the condition", timeout_s=DEADLINE_S, interval_s=POLL_S):
    """Call ``condition()`` every ``interval_s`` [s] of wall time and return its first true result.

    what: description of the condition, for the error; a function is called then, to report the progress. Raises
    AssertionError after ``timeout_s`` [s] of wall time; the last call is after the deadline, so that a stopped process
    does not fail. It waits STRETCH times as long.
    """
    timeout_s *= STRETCH
    deadline = time.monotonic() + timeout_s
    while True:
        is_last = time.monotonic() > deadline
        answer = condition()
        if answer:
            return answer
        if is_last:
            raise AssertionError("waited %g s for %s" % (timeout_s, what() if callable(what) else what))
        time.sleep(interval_s)


def wait_for_time(seconds, timeout_s=DEADLINE_S):
    """Wait until rospy's time has gone on by ``seconds`` [s]; rospy.sleep waits for ever where the clock stands still.

    Raises AssertionError after ``timeout_s`` [s] of wall time.
    """
    import rospy

    begin = rospy.get_time()
    wait_until(lambda: rospy.get_time() >= begin + seconds, "the clock to go on by %g s" % seconds, timeout_s,
               interval_s=min(POLL_S, 0.2 * seconds))


def beats(rate_hz, is_over):
    """Yield at ``rate_hz`` of wall time until ``is_over()`` is true: the pace of a part that publishes.

    Beats that were missed are left out.
    """
    period_s = 1.0 / rate_hz
    beat = time.monotonic()
    while not is_over():
        yield
        beat = max(beat + period_s, time.monotonic())
        time.sleep(max(0.0, beat - time.monotonic()))


def wait_for_publishers(subscriber, *nodes, timeout_s=DEADLINE_S):
    """Wait until ``subscriber`` (a ``rospy.Subscriber``) is connected to these nodes, by their absolute names; others
    do not count.

    Raises AssertionError after ``timeout_s`` [s] of wall time.
    """
    def missing():
        return set(nodes) - {connection.callerid_pub for connection in list(subscriber.impl.connections)}

    wait_until(lambda: not missing(), lambda: "%s on %s" % (", ".join(sorted(missing())), subscriber.name), timeout_s)


def wait_for_message(topic, message_class, wanted=lambda message: True, timeout_s=DEADLINE_S):
    """The first message on ``topic`` for which ``wanted(message)`` is true.

    Raises AssertionError after ``timeout_s`` [s] of wall time.
    """
    import rospy  # a unit test that only waits needs no ROS

    found, done = [], threading.Event()

    def take(message):
        if not done.is_set() and wanted(message):
            found.append(message)
            done.set()

    subscriber = rospy.Subscriber(topic, message_class, take, queue_size=1, buff_size=1 << 24)
    try:
        if not done.wait(timeout_s * STRETCH):
            raise AssertionError("no message that fits on %s within %g s" % (topic, timeout_s))
    finally:
        subscriber.unregister()
    return found[0]
