# SPDX-License-Identifier: BSD-3-Clause
"""Programs that draw leave the processors to others, in a session of their own as well."""
import contextlib
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from lab_testing.waiting import wait_until
from processes.family import is_running

# It counts on one processor, the first of those allowed, and says when it begins.
SPIN = """
import os
os.sched_setaffinity(0, [min(os.sched_getaffinity(0))])
print(flush=True)
while True:
    pass
"""


def used_s(process):
    """Processor time of a process [s] (proc(5))."""
    ticks = Path("/proc/%d/stat" % process.pid).read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(ticks[11]) + int(ticks[12])) / os.sysconf("SC_CLK_TCK")


@pytest.mark.parametrize("own_session", [False, True])
def test_a_program_that_draws_gives_way(own_session):
    spin = [sys.executable, "-c", SPIN]
    with contextlib.ExitStack() as ending:
        started = []
        for words in (spin, [sys.executable, "-m", "sensor_renderer.priority", "19", *spin]):
            started.append(ending.enter_context(subprocess.Popen(words, stdout=subprocess.PIPE,
                                                                 start_new_session=own_session)))
            ending.callback(started[-1].kill)
        for process in started:
            process.stdout.readline()
        before = [used_s(process) for process in started]
        wait_until(lambda: used_s(started[0]) - before[0] >= 1.0, "a second of processor time", 60.0)
        physics, drawing = (used_s(process) - earlier for process, earlier in zip(started, before, strict=True))
    assert drawing < 0.2 * physics


def test_a_terminals_other_programs_keep_their_priority():
    words = ["sh", "-c", "%s -m sensor_renderer.priority 19 true; cat /proc/self/autogroup" % sys.executable]
    done = subprocess.run(words, capture_output=True, text=True, start_new_session=True)
    if "autogroup" not in done.stdout:
        pytest.skip("this kernel has no groups of sessions")
    assert done.stdout.split()[-1] == "0"


@pytest.mark.parametrize(("words", "said"), [
    ([], "usage:"), (["20", "true"], "0 to 19"), (["5", "/nowhere/it"], "/nowhere/it cannot be run: No such file")])
def test_wrong_words_are_said(words, said):
    done = subprocess.run([sys.executable, "-m", "sensor_renderer.priority", *words], capture_output=True, text=True)
    assert done.returncode == 1 and said in done.stderr


FAULTS = """
import os, signal, sys
with open(sys.argv[1], "a") as starts:
    starts.write("x")
if os.path.getsize(sys.argv[1]) <= int(sys.argv[2]):
    os.kill(os.getpid(), signal.SIGSEGV)
sys.exit(7)
"""


@pytest.mark.parametrize(("faults", "starts", "code"), [(0, 1, 7), (1, 2, 7), (9, 3, -signal.SIGSEGV)])
def test_a_window_that_dies_as_it_opens_is_opened_again(tmp_path, faults, starts, code):
    words = ["-m", "sensor_renderer.priority", "1", sys.executable, "-c", FAULTS, str(tmp_path / "starts"), str(faults)]
    done = subprocess.run([sys.executable, *words], capture_output=True, text=True)
    assert (done.returncode, (tmp_path / "starts").read_text()) == (code, "x" * starts)
    assert done.stderr.count("segmentation fault") == starts - 1


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_a_signal_ends_the_program_that_draws(number):
    loop = "import os, time; print(os.getpid(), flush=True); time.sleep(60)"
    with subprocess.Popen([sys.executable, "-m", "sensor_renderer.priority", "1", sys.executable, "-c", loop],
                          stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, start_new_session=True) as process:
        program = int(process.stdout.readline())
        process.send_signal(number)
        assert process.wait(30) == -number
        wait_until(lambda: not is_running(program), "the end of the program", 30.0)
