# SPDX-License-Identifier: BSD-3-Clause
"""Memory and processes of episodes: limits, and processes that end with their worker, whoever is killed."""
import os
import shlex
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from lab_batch import JobError, Spec, command, keeping
from lab_batch.processes import BatchLimits, map_seeds
from lab_testing.waiting import wait_until
from processes.family import is_running

HERE = Path(__file__).parent
# A worker starts in a new Python, which reads the jobs from this folder.


@pytest.fixture(autouse=True)
def jobs_can_be_imported(monkeypatch):
    monkeypatch.syspath_prepend(str(HERE))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(HERE), os.environ.get("PYTHONPATH", "")]))


def test_too_much_memory_costs_its_episode_only(tmp_path):
    """Taken at once, taken and kept, and taken by three programs none of which exceeds the limit."""
    spec = Spec("small_jobs:Hog", {"at_once": [1], "keeps": [3], "programs": [5], "folder": str(tmp_path)})
    found = {one.seed: one for one in map_seeds(spec, range(8), BatchLimits(1, memory_bytes=500_000_000))}
    assert sorted(found) == list(range(8))
    assert sorted(seed for seed, one in found.items() if not one.is_done) == [1, 3, 5], found
    for seed in (1, 3):
        assert "MemoryError" in found[seed].error and "the limit of memory is 0.5 GB" in found[seed].error
    assert found[5].error == "with its processes it took more than the limit of 0.5 GB of memory"
    programs = [int(word) for word in (tmp_path / "programs").read_text().split()]
    wait_until(lambda: not any(map(is_running, programs)), "the programs have ended")


def test_a_job_that_takes_too_much_when_it_starts_cannot_start():
    with pytest.raises(JobError, match="cannot start: .*MemoryError.*; the limit of memory is 0.2 GB"):
        list(map_seeds(Spec("small_jobs:HogAtStart"), [0], BatchLimits(1, memory_bytes=200_000_000)))


def test_by_default_workers_share_what_the_machine_has(tmp_path):
    for name, text in (("proc/meminfo", "MemTotal:        8000000 kB\nMemFree: 1 kB\n"),
                       ("sys/fs/cgroup/memory.max", "max\n")):
        (tmp_path / name).parent.mkdir(parents=True)
        (tmp_path / name).write_text(text)
    assert keeping.default_memory_bytes(4, tmp_path) == int(0.8 * 8_000_000 * 1024 / 4)
    (tmp_path / "sys/fs/cgroup/memory.max").write_text("1000000000\n")
    assert keeping.default_memory_bytes(4, tmp_path) == 200_000_000


def test_a_failure_is_repeated_with_the_same_memory():
    """Where it is not what that command would have by default."""
    for words, expected in ((["--memory", "1.5"], ["--memory", "1.5"]), ([], [])):
        options = command.parse(["mine:Job", "--seeds", "0:3", *words])
        line = shlex.split(command.repeating_line(options, 2))
        assert line[line.index("2") + 1:-2] == expected
    more_workers = command.parse(["mine:Job", "--seeds", "0:3", "--workers", str(3 * os.cpu_count())])
    line = shlex.split(command.repeating_line(more_workers, 2))
    again = command.parse(line[line.index("batch") + 1:])
    assert command.memory_bytes_of(again) == pytest.approx(command.memory_bytes_of(more_workers), rel=0.01)


@pytest.mark.parametrize("text", ["0", "-1", "x", "0.01", "nan"])
def test_wrong_memory(text, capsys):
    with pytest.raises(SystemExit):
        command.parse(["mine:Job", "--seeds", "1", "--memory", text])
    assert text in capsys.readouterr().err


@pytest.mark.parametrize("who", ["batch", "worker"])
def test_a_program_ends_with_whoever_is_killed(tmp_path, who):
    """Also one that heeds neither Ctrl-C nor SIGTERM, and has a session of its own."""
    text = ("import os, signal, sys; signal.signal(2, signal.SIG_IGN); signal.signal(15, signal.SIG_IGN); os.setsid(); "
            "open(sys.argv[1], 'w').write('%d ' % os.getpid()); signal.pause()")
    program = shlex.join([sys.executable, "-c", text, str(tmp_path / "program")])
    words = [sys.executable, "-m", "lab_batch", "command", "--seeds", "1", "--out", str(tmp_path / "r"), "--set",
             "command=%s" % program]
    batch = subprocess.Popen(words)
    try:
        file = tmp_path / "program"
        wait_until(lambda: file.exists() and file.read_text(), "the program runs", 60.0)
        program = int(file.read_text())
        worker, keeper = parent_of(program), parent_of(parent_of(program))
        assert parent_of(keeper) == batch.pid
        os.kill({"batch": batch.pid, "worker": worker}[who], signal.SIGKILL)
        wait_until(lambda: not is_running(program), "the program has ended", 30.0)
        wait_until(lambda: not is_running(worker) and not is_running(keeper), "worker and keeper have ended")
    finally:
        batch.terminate()
        batch.wait()


def parent_of(pid):
    return int(Path("/proc/%d/stat" % pid).read_text().split(")")[-1].split()[1])
