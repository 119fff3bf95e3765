# SPDX-License-Identifier: BSD-3-Clause
import os
import subprocess
import unittest
from types import SimpleNamespace

import pytest
import rospy

from lab_testing import subtests, waiting
from lab_testing.processes import is_alive, living
from lab_testing.waiting import beats, wait_for_publishers, wait_for_time, wait_until


@pytest.fixture(autouse=True)
def limits_as_written(monkeypatch):
    monkeypatch.setattr(waiting, "STRETCH", 1.0)


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


def test_beats_keep_their_rate_and_leave_out_missed_ones(monkeypatch):
    class Clock:
        now = 0.0

        def monotonic(self):
            return self.now

        def sleep(self, seconds):
            self.now += seconds

    clock, seen = Clock(), []
    monkeypatch.setattr(waiting, "time", clock)
    for _ in beats(100.0, lambda: len(seen) == 5):
        seen.append(round(clock.now, 6))
        clock.now += 0.025 if len(seen) == 2 else 0.002  # the second is slow
    assert seen == [0.0, 0.01, 0.035, 0.045, 0.055]


def test_a_clock_that_stands_still_ends_a_wait_for_time(monkeypatch):
    now = iter([5.0, 5.1, 5.19, 5.2])
    monkeypatch.setattr(rospy, "get_time", lambda: next(now))
    wait_for_time(0.2)
    assert next(now, None) is None
    monkeypatch.setattr(rospy, "get_time", lambda: 5.0)
    with pytest.raises(AssertionError, match="clock"):
        wait_for_time(0.2, timeout_s=0.05)


def test_a_share_of_the_machine_makes_deadlines_longer(monkeypatch):
    asked = []
    monkeypatch.setattr(waiting, "STRETCH", 100.0)
    assert wait_until(lambda: asked.append(1) or len(asked) == 5, timeout_s=0.01, interval_s=0.02)


def test_publishers_are_told_by_their_names():
    subscriber = SimpleNamespace(name="/rosout", impl=SimpleNamespace(
        connections=[SimpleNamespace(callerid_pub=node) for node in ("/rosout", "/gazebo", "/other")]))
    wait_for_publishers(subscriber, "/gazebo", "/other")
    with pytest.raises(AssertionError, match="waited 0.05 s for /sensor_renderer on /rosout"):
        wait_for_publishers(subscriber, "/gazebo", "/sensor_renderer", timeout_s=0.05)


def test_the_dead_that_nobody_has_buried_are_not_alive():
    child = subprocess.Popen(["sleep", "600"], start_new_session=True)
    assert is_alive(child.pid)
    wait_until(lambda: any("sleep 600" in line for line in living(child.pid)), "the child's command line")
    child.kill()
    os.waitid(os.P_PID, child.pid, os.WEXITED | os.WNOWAIT)  # it is dead, and stays a zombie
    assert not is_alive(child.pid) and living(child.pid) == []
    child.wait()
    assert not is_alive(child.pid)


def test_each_failed_sub_test_is_in_the_report_of_its_test(capfd):
    class Case(subtests.TestCase):
        def test_some(self):
            for number in range(4):
                with self.subTest("one", number=number):
                    self.assertEqual(number % 2, 0, "odd %d" % number)

        def test_good(self):
            with self.subTest("fine"):
                pass

    result = unittest.TestResult()
    unittest.defaultTestLoader.loadTestsFromTestCase(Case).run(result)
    assert result.testsRun == 2 and not result.errors
    (_, text), = result.failures
    assert "2 sub-tests failed" in text
    assert all(said in text for said in ("(one, number=1)", "odd 1", "(one, number=3)", "odd 3"))
    assert "odd 2" not in text
