# SPDX-License-Identifier: BSD-3-Clause
"""The judge's own lab, as far as it needs no simulator: how a start that fails is told."""
import subprocess
import sys
import time

import pytest
from rosmaster.master import Master

from lab_environment import master_calls
from lab_environment.ports import free_port
from lab_testing.processes import is_alive
from lab_testing.waiting import wait_until
from rf_checks.lab import Lab, LabFailed, TooSlow


@pytest.fixture
def lab(tmp_path):
    """A lab that is a process which does nothing."""
    lab = Lab("<robot/>", walls=False)
    lab._folder = tmp_path
    (tmp_path / "output.txt").write_text("")
    lab._run([sys.executable, "-c", "import time; time.sleep(1000)"], None)
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
            "lab._folder = Path(sys.argv[1])\nlab._run([sys.executable, '-c', 'import time; print(1, flush=True); "
            "time.sleep(1000)'], None)\n"
            "print(lab._processes[0].pid, flush=True)\nsys.stdin.read()\n")
    with subprocess.Popen([sys.executable, "-c", text, tmp_path], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                          text=True) as judge:
        pid = int(judge.stdout.readline())
        assert is_alive(pid)
        wait_until(lambda: (tmp_path / "output.txt").read_text(), "the lab to have started")
        judge.kill()
    wait_until(lambda: not is_alive(pid), "the end of the lab")


@pytest.fixture
def master():
    """A ROS master, in a thread of this process."""
    master = Master(port=free_port())
    master.start()
    yield master
    master.stop()


def test_strangers_that_are_gone_are_taken_off_the_masters_lists(lab, master):
    lab.uri, lab.own_nodes = master.uri, frozenset(("/gazebo",))
    for node in ("/gazebo", "/student"):
        entry = master_calls.master(node, master.uri, 10.0)
        entry.registerPublisher("/shared", "std_msgs/Empty", "http://127.0.0.1:1/" + node)
        entry.registerSubscriber("/heard", "std_msgs/Empty", "http://127.0.0.1:1/" + node)
        entry.registerService(node + "/service", "rosrpc://127.0.0.1:1", "http://127.0.0.1:1/" + node)
    assert lab.nodes() == {"/gazebo", "/student"}
    lab.forget_strangers()
    assert lab.nodes() == {"/gazebo"}
    assert lab._state() == [[["/shared", ["/gazebo"]]], [["/heard", ["/gazebo"]]], [["/gazebo/service", ["/gazebo"]]]]


def test_a_master_that_is_gone_is_named(lab):
    lab.uri = "http://127.0.0.1:%d" % free_port()
    with pytest.raises(LabFailed, match="the ROS master is gone"):
        lab.nodes()
