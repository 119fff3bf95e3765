# SPDX-License-Identifier: BSD-3-Clause
"""The clocks of a check: simulated time in place of the program's own, and limits that do not depend on the machine's
load. No master, no simulator."""
import errno
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from lab_testing.waiting import wait_until
from rf_checks import pacing
from rf_checks.run_clock import VARIABLE, RunClock
from rf_checks.sandbox import Startup

STUDENT = Path(__file__).resolve().parents[2] / "student"
STEP_S = 0.01


@pytest.fixture
def clock():
    clock = RunClock()
    yield clock
    clock.close()


def start(clock, text, python_path="", **environment):
    return subprocess.Popen([sys.executable, "-c", text], stdout=subprocess.PIPE, text=True,
                            env={**os.environ, "PYTHONPATH": Startup.python_path(str(STUDENT), str(python_path)),
                                 **clock.environment, **environment}, pass_fds=(clock.descriptor,))


def at_rest(watch):
    wait_until(watch.wait_until_rest, "the program to rest")


@pytest.mark.parametrize("slept", ["time.sleep(1.0)", "[time.sleep(0.001) for _ in range(1000)]",
                                   "from time import sleep; sleep(0.6); sleep(0.4)"])
def test_a_program_sleeps_in_simulated_time_however_long_that_takes(clock, slept):
    text = "import time\nfor _ in range(2):\n    %s\n    print(time.time(), time.monotonic(), flush=True)"
    with start(clock, text % slept) as program:
        watch = pacing.Watch()
        watch.program.roots = (program.pid,)
        at_rest(watch)
        steps = []
        for k in range(1, 300):
            clock.advance(STEP_S)
            at_rest(watch)
            if program.poll() is not None:
                steps.append(k)
                break
        watch.close()
        lines = [[float(word) for word in line.split()] for line in program.stdout]
    # Two seconds; a sleep may end one step early.
    assert 197 <= steps[0] <= 200
    assert [b - a for a, b in zip(*lines, strict=True)] == pytest.approx([1.0, 1.0], abs=3 * STEP_S)


def test_the_clock_works_where_the_kernel_refuses_files_in_memory(monkeypatch):
    def refuse(*_):
        raise OSError(errno.ENOSYS, "Function not implemented")

    monkeypatch.setattr(os, "memfd_create", refuse)
    clock = RunClock()
    try:
        clock.advance(1000.0)
        before = time.time()
        with start(clock, "import time\nprint(time.time())") as program:
            assert float(program.stdout.readline()) >= before + 900.0
        with pytest.raises(OSError, match=os.strerror(errno.EBADF)):
            os.write(clock.descriptor, b"x")
    finally:
        clock.close()


def test_simulated_clocks_never_stand_and_never_go_back(clock):
    text = ("import time\nlast = time.monotonic_ns()\nprint(time.time(), flush=True)\nend = time.process_time() + 0.5\n"
            "while time.process_time() < end:\n    now = time.monotonic_ns()\n    assert now >= last\n    last = now\n"
            "first = time.monotonic()\nwhile time.monotonic() == first:\n    pass\nprint('on')")
    with start(clock, text) as program:
        began = float(program.stdout.readline())
        assert abs(began - time.time()) < 3600.0
        while program.poll() is None:
            clock.advance(STEP_S)
        assert program.stdout.read() == "on\n"
        assert program.returncode == 0


@pytest.mark.parametrize("environment", [{VARIABLE: "999"}, {VARIABLE: "x"}, {VARIABLE: "0"}],
                         ids=["closed", "no number", "another file"])
def test_a_program_without_the_page_has_the_clock_of_the_wall(clock, environment):
    with start(clock, "import time; time.sleep(0.05); print(time.sleep.__class__.__name__)", **environment) as program:
        assert program.stdout.read() == "builtin_function_or_method\n"
        assert program.wait() == 0


def test_the_labs_own_environment_is_there_as_well(clock, tmp_path):
    (tmp_path / "rospy").mkdir()
    (tmp_path / "rospy/__init__.py").write_text("from .client import init_node\n")
    (tmp_path / "rospy/client.py").write_text("def init_node(name):\n    return name\n")
    # A user's own sitecustomize must not disturb either.
    (tmp_path / "sitecustomize.py").write_text("print('not this one')\n")
    text = ("import time, rospy, rospy_fixes.first_clock as first_clock\n"
            "print(rospy.init_node.__wrapped__.__module__, type(time.sleep).__name__, first_clock.time is time)")
    with start(clock, text, tmp_path) as program:
        assert program.stdout.read() == "rospy.client method True\n"


def test_a_program_cannot_write_to_the_clock(clock):
    text = "import os\ntry:\n    os.write(%d, b'x')\nexcept OSError as error:\n    print(error.strerror)"
    with start(clock, text % clock.descriptor) as program:
        assert program.stdout.read() == "Bad file descriptor\n"


def test_nor_may_it_open_the_page_again_to_write_or_to_cut(clock):
    text = ("import mmap, os\npage = os.open('/proc/self/fd/%d', os.O_RDWR)\n"
            "for harm in (lambda: os.write(page, b'x'), lambda: os.ftruncate(page, 0),\n"
            "             lambda: mmap.mmap(page, mmap.PAGESIZE)):\n"
            "    try:\n        harm()\n        print('done')\n"
            "    except PermissionError:\n        print('refused')")
    with start(clock, text % clock.descriptor) as program:
        assert program.stdout.read() == "refused\n" * 3
    clock.advance(STEP_S)


def test_own_time_is_wall_time_at_rest_and_processor_time_in_computing():
    with (subprocess.Popen(["sleep", "1000"]) as sleeper,
          subprocess.Popen([sys.executable, "-c", "while True: pass"]) as busy):
        resting, computing = (pacing.OwnTime(lambda pid=process.pid: [pid]) for process in (sleeper, busy))
        wait_until(lambda: resting.passed_s() > 0.3, "the time of a program that rests to pass")
        used_s = pacing.cpu_time_s([busy.pid])
        computing.restart()
        wait_until(lambda: computing.passed_s() > 0.3, "the time of a program that computes to pass")
        assert pacing.cpu_time_s([busy.pid]) - used_s == pytest.approx(computing.passed_s(), abs=0.2)
        for process in (sleeper, busy):
            process.kill()
        resting.close()
        computing.close()


def test_own_time_does_not_pass_while_waiting_for_a_processor(monkeypatch):
    # As the kernel shows it: runnable, without processor time.
    with subprocess.Popen(["sleep", "1000"]) as sleeper:
        monkeypatch.setattr(pacing.ProcessTree, "runs", lambda self: True)
        own_time = pacing.OwnTime(lambda: [sleeper.pid])
        began = time.monotonic()
        wait_until(lambda: own_time.passed_s() is not None and time.monotonic() > began + 0.3, "0.3 s on the wall")
        assert own_time.passed_s() < 0.1
        sleeper.kill()
        own_time.close()
