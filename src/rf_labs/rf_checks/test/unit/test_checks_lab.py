# SPDX-License-Identifier: BSD-3-Clause
"""The judge's own lab, without a simulator: messages of a failed start."""
import subprocess
import sys
import time

import pytest

from lab_testing.processes import is_alive
from lab_testing.waiting import wait_until
from rf_checks.lab import Lab, LabFailed, TooSlow


@pytest.fixture
def lab(tmp_path):
    """A lab that is a process which does nothing."""
    lab = Lab("<robot/>", walls=False)
    lab._folder = tmp_path
    (tmp_path / "output.txt").write_text("")
    lab._run([sys.executable, "-c", "import signal; signal.pause()"], None)
    lab._own_time.restart()
    yield lab
    lab.close()


def test_a_node_that_died_ends_the_wait_at_once(lab):
    (lab.folder / "output.txt").write_text("process[gazebo-1]: started with pid [17]\n\x1b[31m[urdf_spawner-5] process "
                                           "has died [pid 28, exit code 1, cmd spawn_baxter neutral].\n")
    with pytest.raises(LabFailed, match="the robot: urdf_spawner-5 ended"):
        lab._await(lambda: False, "the robot", time.monotonic() + 1000.0)


@pytest.mark.parametrize("line", ["[gazebo-1] process has died [pid 28, exit code 0, cmd x].",
                                  "[urdf_spawner-5] process has finished cleanly"])
def test_a_node_that_is_done_ends_nothing(lab, line):
    (lab.folder / "output.txt").write_text(line + "\n")
    with pytest.raises(TooSlow, match="waiting for the robot"):
        lab._await(lambda: False, "the robot", time.monotonic() + 0.2)


def test_a_lab_ends_with_its_judge(tmp_path):
    text = ("import os, sys\nfrom pathlib import Path\nfrom rf_checks.lab import Lab\n"
            "lab = Lab('<robot/>', walls=False)\n"
            "lab._folder = Path(sys.argv[1])\nlab._run([sys.executable, '-c', 'import signal; print(1, flush=True); "
            "signal.pause()'], None)\n"
            "print(lab._processes[0].pid, flush=True)\nsys.stdin.read()\n")
    with subprocess.Popen([sys.executable, "-c", text, tmp_path], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                          text=True) as judge:
        pid = int(judge.stdout.readline())
        assert is_alive(pid)
        wait_until(lambda: (tmp_path / "output.txt").read_text(), "the lab to have started")
        judge.kill()
    wait_until(lambda: not is_alive(pid), "the end of the lab")
