# SPDX-License-Identifier: BSD-3-Clause
"""The number of processes of a lab, counted by Linux itself, in sandboxes of a user other than root."""
import os
import subprocess

import pytest

from lab_class.launching import limited
from processes import isolation

TASKS = 40
# Starts processes until it cannot; they wait for the end of their standard input, which they share.
PROGRAM = """
import os, sys
count = 0
try:
    while count < %d:
        if os.fork() == 0:
            sys.stdin.read()
            os._exit(0)
        count += 1
except BlockingIOError:
    pass
print(count, flush=True)
sys.stdin.read()
""" % (2 * TASKS)


@pytest.fixture
def start():
    if isolation.problem():
        pytest.skip(isolation.problem())
    as_other = ["setpriv", "--reuid=nobody", "--regid=nogroup", "--clear-groups"] if os.geteuid() == 0 else []
    started = []

    def begin():
        started.append(subprocess.Popen(
            [*as_other, "bwrap", "--unshare-user", "--unshare-pid", "--die-with-parent", "--ro-bind", "/", "/",
             "--proc", "/proc", "--", *limited(2**20, TASKS), "/usr/bin/python3", "-c", PROGRAM],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd="/"))
        return started[-1]

    yield begin
    for process in started:
        process.communicate(timeout=60.0)


def test_a_lab_that_starts_processes_without_end_is_stopped_and_leaves_others_theirs(start):
    first, second = start(), start()
    counts = [int(process.stdout.readline()) for process in (first, second)]
    # Both at once have more than the limit.
    assert all(0.8 * TASKS < count < TASKS for count in counts)


def test_files_are_limited_everywhere_and_processes_in_a_sandbox_alone():
    assert limited(1000, None) == ["prlimit", "--core=0", "--fsize=1000", "--"]
    assert limited(1000, 50) == ["prlimit", "--core=0", "--fsize=1000", "--nproc=50", "--"]
