# SPDX-License-Identifier: BSD-3-Clause
"""A pytest plugin that fails a run whose threads still compute after the last test.

Such a thread, a server on a closed socket for example, takes processor time from all tests that follow: ten times as
long, without a word. ``-p lab_tests.left_threads`` in a run of single files finds the one that leaves it.
"""
import threading
import time

import pytest

# Wall time of a look [s], and the share of a core from which on something runs. Compilers' threads end soon.
_LOOK_S, _SHARE = 0.2, 0.5
_LOOKS = 15


def is_busy():
    """Whether this process computes while this thread waits, in every one of some looks."""
    for _ in range(_LOOKS):
        begin, before = time.monotonic(), time.process_time()
        time.sleep(_LOOK_S)
        if time.process_time() - before < _SHARE * (time.monotonic() - begin):
            return False
    return True


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session):
    if session.testscollected and is_busy():
        names = ", ".join(sorted({thread.name for thread in threading.enumerate()}))
        print("\nafter the last test, threads of this process still compute; there are: %s" % names)
        session.exitstatus = pytest.ExitCode.TESTS_FAILED
