# SPDX-License-Identifier: BSD-3-Clause
"""The process that a student's program runs in: its limits, its end, and what it cannot reach. No master."""
import os
import subprocess
import sys

import pytest

from lab_testing.waiting import wait_until
from rf_checks import pacing
from rf_checks.sandbox import KEPT_BYTES, OUTPUT_BYTES, Student, adopt_orphans, has_namespaces

WAIT_S = 30.0
KINDS = [False, pytest.param(True, marks=pytest.mark.skipif(
    not has_namespaces(), reason="this machine lets nobody make namespaces"))]


@pytest.fixture(params=KINDS, ids=["session", "namespaces"])
def start(request, tmp_path):
    """Start a program (text) in the sandbox; ended afterwards."""
    (tmp_path / "workspace").mkdir()
    (tmp_path / "judge").mkdir()
    (tmp_path / "judge" / "secret").write_text("42")
    adopt_orphans()
    students = []

    def run(text, *words):
        environment = {**os.environ, "JUDGE": str(tmp_path / "judge"), "WORKSPACE": str(tmp_path / "workspace")}
        students.append(Student([sys.executable, "-c", text, *words], environment, tmp_path / "workspace",
                                tmp_path / "judge", request.param))
        return students[-1]

    run.has_namespaces = request.param
    yield run
    for student in students:
        student.end()


def finished(student):
    wait_until(lambda: student.exit_code is not None, "the program's end")
    student.end()
    return student


def test_words_output_and_exit_code_come_through(start):
    student = finished(start("import sys; print(sys.argv[1:]); print('oh', file=sys.stderr); sys.exit(3)", "a", "b c"))
    assert student.exit_code == 3
    assert student.output == "['a', 'b c']\n"
    assert student.errors == "oh\n"
    assert student.survivors == 0


def test_what_outlives_the_program_is_found_and_ended(start):
    # A session of its own, and no environment that could give it away.
    child = "import subprocess, sys; subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(1000)'], " \
            "env={}, start_new_session=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)"
    before = pacing.children_of([os.getpid()])
    student = finished(start(child))
    # In a process namespace of its own the child dies with its parent.
    assert student.survivors == (0 if start.has_namespaces else 1)
    assert pacing.children_of([os.getpid()]) - before == set()


def test_endless_output_neither_fills_memory_nor_stops_the_judge(start):
    student = start("while True: print('x' * 1000)")
    wait_until(lambda: student.wrote_too_much, "%d bytes" % OUTPUT_BYTES)
    student.end()
    assert len(student.output) <= 2 * KEPT_BYTES + 8192


def test_a_program_that_loops_says_where_it_is(start):
    student = start("print('on', flush=True)\nn = 0\nwhile True:\n    n += 1\n")
    wait_until(lambda: student.output, "its first line")
    before = pacing.cpu_time_s(student.family())
    wait_until(lambda: pacing.cpu_time_s(student.family()) > before + 0.1, "it to be in its loop")
    student.dump()
    assert "line 4" in student.errors or "line 3" in student.errors
    student.end()
    assert student.exit_code is not None


def test_the_judge_is_out_of_reach(start):
    if not start.has_namespaces:
        pytest.skip("needs namespaces")
    student = finished(start(
        "import os\nprint(os.listdir(os.environ['JUDGE']))\n"
        "print(sorted(int(n) for n in os.listdir('/proc') if n.isdigit()))\n"
        "try:\n    open(os.environ['WORKSPACE'] + '/x', 'w')\nexcept OSError as error:\n    print(error.strerror)"))
    assert student.output.splitlines() == ["[]", "[1]", "Read-only file system"], student.errors


def test_files_have_a_limit(start):
    student = finished(start("open('big', 'wb').write(bytes(50 << 20))"))
    assert "File too large" in student.errors


def test_a_watch_tells_work_from_rest(start):
    student = start("import time\nprint('on', flush=True)\ntime.sleep(1000)")
    wait_until(lambda: student.output, "its first line")
    watch = pacing.Watch()
    watch.program.roots = (student.pid,)
    wait_until(watch.wait_until_rest, "a program that sleeps to rest")
    busy = start("print('on', flush=True)\nwhile True: pass")
    wait_until(lambda: busy.output, "its first line")
    watch.program.roots = (busy.pid,)
    for _ in range(3):
        before = pacing.cpu_time_s(busy.family())
        assert not watch.wait_until_rest()
        # However long it has to wait for a processor: what it gets is what counts.
        assert pacing.cpu_time_s(busy.family()) - before > 0.9 * pacing.PROGRAM_ALLOWANCE_S
    watch.close()


def test_a_process_that_got_the_number_of_an_ended_program_is_a_stranger(start):
    with subprocess.Popen(["sleep", "1000"]) as stranger:
        student = start("")
        wait_until(lambda: student.exit_code is not None, "the program's end")
        student._process.pid = stranger.pid
        student.end()
        assert student.survivors == 0
        assert stranger.poll() is None
        stranger.kill()
