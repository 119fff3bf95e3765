# SPDX-License-Identifier: BSD-3-Clause
import pytest

from lab_testing import waiting
from lab_testing.waiting import wait_until


def test_the_first_true_answer_is_returned():
    answers = iter([None, 0, "third", "fourth"])
    assert wait_until(lambda: next(answers), interval_s=0.0) == "third"


def test_the_error_says_what_was_awaited_and_how_far_it_came():
    count = []
    with pytest.raises(AssertionError, match=r"waited 0.05 s for ten beats, got [1-9]"):
        wait_until(lambda: count.append(1), lambda: "ten beats, got %d" % len(count), timeout_s=0.05)


def test_the_condition_is_asked_once_more_after_the_deadline(monkeypatch):
    class Clock:
        now = 0.0

        def monotonic(self):
            return self.now

        def sleep(self, seconds):
            self.now += 100.0  # as if the machine had stood still

    monkeypatch.setattr(waiting, "time", Clock())
    asked = []
    assert wait_until(lambda: asked.append(1) or len(asked) == 2, timeout_s=1.0)
    with pytest.raises(AssertionError):
        wait_until(lambda: asked.append(1) or len(asked) == 5, timeout_s=1.0)
