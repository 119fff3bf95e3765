# SPDX-License-Identifier: BSD-3-Clause
"""Loops go on after errors that nobody foresaw, and threads that an error ends are counted."""
import threading

from rospy_fixes.ports.event_log import EventLog
from rospy_fixes.ports.threads import ThreadFaults, lasting


def run(loop, ends):
    log = []
    faults = ThreadFaults(EventLog(log.append))
    lasting(faults, "the hands", loop, retry_s=0.0)(ends)
    return log, faults


def test_a_loop_goes_on_after_errors_and_logs_them_once_in_a_while():
    left = [OverflowError("too large"), SystemExit(1), ValueError("again")]

    def loop(ends):
        while left:
            raise left.pop(0)
        ended.set()
    ended = threading.Event()
    log, faults = run(loop, ended.is_set)
    assert ended.is_set() and left == []
    assert len(log) == 1 and "the hands: OverflowError: too large" in log[0]
    text, values = faults.summary()
    assert text.startswith("3 times") and "ValueError: again" in values["the hands"]


def test_a_loop_that_fails_at_its_end_ends():
    ended = threading.Event()

    def loop(ends):
        ended.set()
        raise KeyError("gone")
    assert "KeyError" in run(loop, ended.is_set)[0][0]


def test_a_fault_that_cannot_be_noted_does_not_end_the_loop():
    class Broken:
        def note(self, place, error, consequence):
            raise OSError("no room for the log")

    left = [ValueError(), ValueError()]

    def loop(ends):
        while left:
            raise left.pop()
    lasting(Broken(), "the hands", loop, retry_s=0.0)(lambda: False)
    assert left == []


def test_threads_that_an_error_ends_are_counted_by_what_they_do(monkeypatch):
    faults, told = ThreadFaults(EventLog([].append)), []
    assert faults.summary() is None
    monkeypatch.setattr(threading, "excepthook", faults.count_ends(told.append))

    def serve():
        raise ZeroDivisionError("by nobody")

    for thread in (threading.Thread(target=serve), threading.Thread(target=serve),
                   threading.Thread(target=serve, name="film")):
        thread.start()
        thread.join(60.0)
    text, values = faults.summary()
    assert set(values) == {"serve", "film"} and values["serve"].startswith("2, ") and faults.news.is_set()
    assert len(told) == 3
