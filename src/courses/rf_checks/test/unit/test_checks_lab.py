# SPDX-License-Identifier: BSD-3-Clause
"""The judge's own lab, without a simulator: messages of a failed start."""
import os
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

from lab_testing.processes import is_alive
from lab_testing.waiting import wait_until
from rf_checks.lab import JudgedLab, LabFailed, TooSlow
from rf_checks.recorder import Recorder
from rf_checks.recorder_names import RECORDS, SOCKETS_VARIABLE
from world_picture.results import READY


@pytest.fixture
def lab(tmp_path, monkeypatch):
    """A lab that is a process which does nothing."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    lab = JudgedLab("<robot/>", walls=False)
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


def test_a_lab_in_a_sandbox_sees_what_set_up_has_made_ready_for_pictures(tmp_path, monkeypatch):
    started = []
    monkeypatch.setattr("rf_checks.lab.subprocess", SimpleNamespace(
        **{**vars(subprocess), "Popen": lambda command, env, **_: started.append((command, env))}))
    ready = tmp_path / "cache" / "bullet_gazebo"
    ready.mkdir(parents=True)
    monkeypatch.setenv("XDG_CACHE_HOME", str(ready.parent))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    lab = JudgedLab("<robot/>", walls=True)
    lab._run(["true"], {"A": "1"})
    (command, environment), = started
    assert environment == {"A": "1", READY: command[command.index(str(ready)) + 1]}


def test_a_lab_ends_with_its_judge(tmp_path):
    text = ("import sys\nfrom rf_checks.lab import JudgedLab\nlab = JudgedLab('<robot/>', walls=False)\n"
            "lab._run([sys.executable, '-c', 'import signal; print(1, flush=True); "
            "signal.pause()'], None)\n"
            "print(lab._processes[0].pid, lab.folder / 'output.txt', flush=True)\nsys.stdin.read()\n")
    with subprocess.Popen([sys.executable, "-c", text], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
                          env={**os.environ, "TMPDIR": str(tmp_path)}) as judge:
        pid, output = judge.stdout.readline().split()
        pid = int(pid)
        assert is_alive(pid)
        wait_until(Path(output).read_text, "the lab to have started")
        judge.kill()
    wait_until(lambda: not is_alive(pid), "the end of the lab")


def test_the_recorder_closes_all_that_changes_the_world(tmp_path, monkeypatch):
    monkeypatch.setenv(SOCKETS_VARIABLE, str(tmp_path))
    closed = []
    open_ways = {
        "served": ["/gazebo/apply_body_wrench", "/gazebo/get_model_state", "/gazebo/something_new", "/robot/sim/press"],
        "subscribed": ["/gazebo/drag", "/gazebo/set_link_state", "/gazebo/later", "/robot/limb/left/joint_command"]}
    context = SimpleNamespace(model=SimpleNamespace(joint_names=["head_pan"], name="baxter"), withdraw=closed.append,
                              **{name: (lambda names=names: names) for name, names in open_ways.items()})
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(tmp_path / RECORDS))
        listener.listen(1)
        recorder = Recorder(context)
        recorder._close_world()
        recorder.close()
    assert closed == ["/gazebo/apply_body_wrench", "/gazebo/something_new", *open_ways["subscribed"][:3]]
