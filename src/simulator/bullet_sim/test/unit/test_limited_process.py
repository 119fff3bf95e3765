# SPDX-License-Identifier: BSD-3-Clause
"""Work in a separate process ends, and its error names the limit."""

import os
import re
import time

import numpy as np
import pytest

from bullet_sim.limited_process import LimitedProcess, LimitError
from lab_testing.waiting import wait_until


@pytest.fixture
def process():
    process = LimitedProcess(processor_s=1, memory_bytes=600_000_000, waiting_s=300.0)
    yield process
    process.close()


def test_it_answers_and_stays_the_same_process(process):
    assert process.call(os.path.join, "a", "b") == "a/b"
    first = process.call(os.getpid)
    assert first != os.getpid() and process.call(os.getpid) == first


def test_what_a_function_raises_comes_back(process):
    with pytest.raises(LimitError, match="No such file"):
        process.call(os.stat, "/no/such/file")
    assert process.call(os.path.join, "a", "b") == "a/b"


def test_a_function_without_end_ends(process):
    with pytest.raises(LimitError, match="more than 1 s of processor time"):
        process.call(re.fullmatch, "(a+)+b", "a" * 60)
    assert process.call(os.path.join, "a", "b") == "a/b"


def test_a_function_that_waits_ends():
    process = LimitedProcess(waiting_s=1.0)
    try:
        with pytest.raises(LimitError, match="it did nothing for 1 s"):
            process.call(time.sleep, 1000)
    finally:
        process.close()


def test_a_function_that_works_may_take_longer_than_one_that_waits():
    process = LimitedProcess(processor_s=60, waiting_s=0.5)
    try:
        begin = time.monotonic()
        assert process.call(re.fullmatch, "(a+)+b", "a" * 25) is None
        assert time.monotonic() - begin > 0.5
    finally:
        process.close()


def test_a_function_that_takes_all_memory_ends(process):
    with pytest.raises(LimitError, match=r"more than 600 MB of memory|Unable to allocate"):
        process.call(np.ones, 10**9)


def test_a_call_holds_neither_the_interpreter_nor_a_process_that_died(process):
    pid = process.call(os.getpid)
    os.kill(pid, 9)
    wait_until(lambda: process._worker.process.poll() is not None, "the process to be gone")
    assert process.call(os.getpid) != pid


def test_it_leaves_nothing_behind(process):
    pid = process.call(os.getpid)
    process.close()
    assert not os.path.exists("/proc/%d" % pid)


def niceness():
    return os.nice(0)


def test_it_gives_way_to_physics_but_not_more_than_that():
    """Also where the program that asks has a lower priority: a user waits for both."""
    process = LimitedProcess()
    try:
        assert process.call(niceness) == max(5, os.nice(0))
    finally:
        process.close()
