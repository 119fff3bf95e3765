# SPDX-License-Identifier: BSD-3-Clause
"""Commands that end with the process that starts them."""
import subprocess
import sys

import pytest

from lab_testing.waiting import wait_until
from processes.family import is_running, with_parent

# Makes the command, and a child that executes it; both wait for their turns.
STARTS = """import os, signal, sys
from processes.family import with_parent
before, text = os.getpid(), "import sys; print('it runs', flush=True); sys.stdin.read()"
signal.signal(signal.SIGINT, signal.SIG_IGN)  # as in a script's background job
command = with_parent([sys.executable, "-c", text], %r)
if os.fork() == 0:
    while %s: pass
    os.execvp(command[0], command)
%s
"""


@pytest.fixture
def start():
    started = []

    def run(until, then, sign="KILL"):
        started.append(subprocess.Popen([sys.executable, "-c", STARTS % (sign, until, then)], stdin=subprocess.PIPE,
                                        stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True))
        return started[-1]

    yield run
    for process in started:
        process.kill()
        process.communicate()


def test_a_command_whose_starter_has_ended_meanwhile_does_not_begin(start):
    assert start("os.getppid() == before", "os._exit(0)").communicate(timeout=60)[0] == ""


@pytest.mark.parametrize("sign", ["KILL", "INT"])
def test_a_command_ends_with_its_starter(start, sign):
    starter = start("False", "os.wait()", sign)
    assert starter.stdout.readline() == "it runs\n"
    with open("/proc/%d/task/%d/children" % (starter.pid, starter.pid), encoding="ascii") as file:
        child = int(file.read())
    starter.kill()
    wait_until(lambda: not is_running(child), "the end of the command")


def test_exit_code_and_words_come_through():
    done = subprocess.run(with_parent(["/bin/sh", "-c", 'echo "$1"; exit 3', "sh", "a  $b"]), capture_output=True,
                          text=True)
    assert (done.returncode, done.stdout) == (3, "a  $b\n")
