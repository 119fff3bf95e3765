# SPDX-License-Identifier: BSD-3-Clause
"""A loop goes on after errors that nobody foresaw, until its end."""
import threading
from types import SimpleNamespace

from lab_web.loops import lasting
from loop_ros.faults import Faults


def run(loop, ends):
    log = []
    lasting(Faults(SimpleNamespace(error=log.append)), "the hands", loop, retry_s=0.0)(ends)
    return log


def test_a_loop_goes_on_after_errors_and_logs_them_once_in_a_while():
    left = [OverflowError("too large"), SystemExit(1), ValueError("again")]

    def loop(ends):
        while left:
            raise left.pop(0)
        ended.set()
    ended = threading.Event()
    log = run(loop, ended.is_set)
    assert ended.is_set() and left == []
    assert len(log) == 1 and log[0].startswith("the hands: OverflowError: too large")


def test_a_loop_that_fails_at_its_end_ends():
    ended = threading.Event()

    def loop(ends):
        ended.set()
        raise KeyError("gone")
    assert "KeyError" in run(loop, ended.is_set)[0]
