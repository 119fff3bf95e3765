# SPDX-License-Identifier: BSD-3-Clause
"""Control groups of a class: which are made, with which limits, on trees of files; and that Linux keeps to them."""
import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest

from lab_class import control_groups
from lab_class.control_groups import SOCKET_BYTES, found, remove_left_over, way_in
from lab_testing.waiting import wait_until

GB = 1 << 30
# Connections whose other ends do not read; prints how many bytes they hold.
FILL_SOCKETS = """
import contextlib, socket
server, ends, held = socket.create_server(("127.0.0.1", 0)), [], 0
while held < 50 << 20:
    ends += [socket.create_connection(server.getsockname()), server.accept()[0]]
    ends[-1].setblocking(False)
    with contextlib.suppress(BlockingIOError):
        while True:
            held += ends[-1].send(bytes(1 << 16))
print(held, flush=True)
input()
"""
MEMORY, MEMORY_LIMIT, TASKS, TASK_LIMIT = 128 << 20, 64 << 20, 100, 200
# As many processes as told, in turns on each processor: Linux shares every processor by the groups' weights, but two
# processes of one lab that it leaves on one of two processors get 2/3 of that one and nothing of the other.
SPIN = """
import os
processors = sorted(os.sched_getaffinity(0))
for number in range(1, %d):
    if os.fork() == 0:
        break
else:
    number = 0
os.sched_setaffinity(0, [processors[number %% len(processors)]])
while True:
    pass
"""


class Tree:
    """Folders and files as the kernel has them, as far as they are read; what was written stays as a file."""

    def __init__(self, top, own, files):
        self.mount, self.own = top / "cgroup", top / "own"
        top.mkdir(exist_ok=True)
        self.own.write_text(own)
        for name, text in files.items():
            (self.mount / name).parent.mkdir(parents=True, exist_ok=True)
            (self.mount / name).write_text(text)

    def read(self, name):
        return (self.mount / name).read_text()


@pytest.fixture
def kernel(monkeypatch):
    """New groups have the files that are written to, as the kernel's have; hands controllers on."""
    def write(path, value):
        path = Path(path)
        if path.name == "cgroup.subtree_control":
            value = " ".join(dict.fromkeys([*path.read_text().split(), str(value).lstrip("+")])) if path.exists() else \
                str(value).lstrip("+")
        path.write_text(str(value))

    monkeypatch.setattr(control_groups, "_write", write)


def written(tree, folder):
    return {path.name: path.read_text() for path in (tree.mount / folder).iterdir() if path.is_file()}


def test_version_1_has_a_folder_for_each_controller_below_our_own(kernel, tmp_path):
    tree = Tree(tmp_path, "3:memory:/service\n2:pids:/gone\n1:cpu,cpuacct:/\n0::/\n",
                {"memory/service/cgroup.procs": "", "pids/cgroup.procs": "", "cpu,cpuacct/cgroup.procs": ""})
    groups = found("class", 6, tree.mount, tree.own)
    assert groups.controllers == ("cpu", "memory", "pids")
    assert groups.folders == [str(tree.mount / name)
                              for name in ("cpu,cpuacct/class", "memory/service/class", "pids/class")]
    lab = groups.lab("anna", 2 * GB, 4096)
    assert [str(path.relative_to(tree.mount)) for path in lab.entrances] == [
        "cpu,cpuacct/class/anna/cgroup.procs", "memory/service/class/anna/cgroup.procs", "pids/class/anna/cgroup.procs"]
    assert written(tree, "memory/service/class/anna") == {"memory.limit_in_bytes": str(2 * GB),
                                                          "memory.memsw.limit_in_bytes": str(2 * GB),
                                                          "memory.kmem.tcp.limit_in_bytes": str(SOCKET_BYTES)}
    assert written(tree, "pids/class/anna") == {"pids.max": "4096"}
    lab.share_processors(0.5)
    assert written(tree, "cpu,cpuacct/class/anna") == {"cpu.shares": "512"}
    assert written(tree, "cpu,cpuacct/class") == {"cpu.shares": "16384"}
    assert written(tree, "cpu,cpuacct/class/front-door") == {"cpu.shares": "10240", "cgroup.procs": str(os.getpid())}


def test_version_2_uses_a_group_in_which_nobody_else_is(kernel, tmp_path):
    tree = Tree(tmp_path, "0::/user/labs.scope\n", {"cgroup.controllers": "cpu memory pids",
                                                    "user/labs.scope/cgroup.procs": "%d\n" % os.getpid()})
    groups = found("class", 6, tree.mount, tree.own)
    assert (groups.controllers, groups.folders) == (("cpu", "memory", "pids"), [])
    assert tree.read("user/labs.scope/front-door/cgroup.procs") == str(os.getpid())
    assert tree.read("user/labs.scope/front-door/cpu.weight") == "1000"
    lab = groups.lab("anna", 2 * GB, 4096)
    assert written(tree, "user/labs.scope/anna") == {"memory.max": str(2 * GB), "memory.swap.max": "0",
                                                     "memory.oom.group": "1", "pids.max": "4096"}
    assert lab.entrances == [tree.mount / "user/labs.scope/anna/cgroup.procs"]
    lab.share_processors(1.0)
    assert tree.read("user/labs.scope/anna/cpu.weight") == "100"


def test_version_2_uses_a_group_above_that_hands_controllers_on(kernel, tmp_path):
    tree = Tree(tmp_path, "0::/a/b\n", {"cgroup.controllers": "cpu memory", "a/b/cgroup.procs": "1\n2\n",
                                        "a/cgroup.subtree_control": "cpu memory"})
    groups = found("class", 6, tree.mount, tree.own)
    assert groups.folders == [str(tree.mount / "a/class")]
    groups.lab("anna", GB, 10)
    assert written(tree, "a/class/anna")["memory.max"] == str(GB)
    assert tree.read("a/class/cpu.weight") == "1600"


@pytest.mark.parametrize(("own", "files", "reason"), [
    ("0::/\n", {}, "none are mounted at"),
    ("0::/a\n", {"cgroup.controllers": "cpu", "a/cgroup.procs": "1\n"}, "a is not this user's"),
    ("1:cpu:/\n", {"cpu/cgroup.procs": "", "cpu/class": "a file in the way"}, "cpu: {exists}"),
])
def test_without_control_groups_it_says_why(tmp_path, own, files, reason):
    tree = Tree(tmp_path, own, files)
    groups = found("class", 6, tree.mount, tree.own)
    assert groups.controllers == () and reason.format(exists=os.strerror(errno.EEXIST)) in str(groups)
    lab = groups.lab("anna", GB, 10)
    assert lab.entrances == [] and lab.memory_bytes() is None and not lab.has_run_out()
    lab.remove()
    groups.remove()


def test_memory_and_lack_of_it_are_read_in_both_versions(kernel, tmp_path):
    first = Tree(tmp_path / "1", "1:memory:/\n", {"memory/cgroup.procs": ""})
    second = Tree(tmp_path / "2", "0::/x\n", {"cgroup.controllers": "memory", "x/cgroup.procs": str(os.getpid())})
    for tree, folder, stat, events in (
            (first, "memory/class/anna", "cache 5\nrss 1\ntotal_cache 9\ntotal_rss 30\ntotal_shmem 12\n",
             ("memory.oom_control", "oom_kill_disable 0\nunder_oom 0\noom_kill %d\n")),
            (second, "x/anna", "anon 30\nfile 7\nshmem 12\n", ("memory.events", "oom 3\noom_kill %d\n"))):
        lab = found("class", 6, tree.mount, tree.own).lab("anna", GB, 10)
        (tree.mount / folder / "memory.stat").write_text(stat)
        assert lab.memory_bytes() == 42 and not lab.has_run_out()
        (tree.mount / folder / events[0]).write_text(events[1] % 0)
        assert not lab.has_run_out()
        (tree.mount / folder / events[0]).write_text(events[1] % 1)
        assert lab.has_run_out()


def test_a_group_of_systemd_is_used_where_it_stays_without_a_session(monkeypatch, tmp_path):
    (tmp_path / "cgroup.controllers").write_text("cpu")
    monkeypatch.setattr(control_groups, "LINGER", tmp_path)
    monkeypatch.setattr(control_groups.shutil, "which", lambda name: "/usr/bin/" + name)
    monkeypatch.setattr(control_groups.os, "geteuid", lambda: 1000)
    asked = []

    def run(command, **_):
        asked.append(command)
        return subprocess.CompletedProcess(command, 0)

    monkeypatch.setattr(control_groups.subprocess, "run", run)
    assert way_in("anna", tmp_path) == [] and asked == []
    (tmp_path / "anna").touch()
    assert way_in("anna", tmp_path) == asked[0][:-1]
    assert asked[0][:4] == ["env", "XDG_RUNTIME_DIR=/run/user/1000", "systemd-run", "--user"]
    (tmp_path / "cgroup.controllers").unlink()
    assert way_in("anna", tmp_path) == []


@pytest.fixture
def groups():
    """Of this machine, in another process: it moves to the front door's group."""
    made = found("lab-class-test-%d" % os.getpid(), 2)
    yield made
    made.remove()


def needs(groups, controller):
    if controller not in groups.controllers:
        pytest.skip(str(groups))


def start(group, program):
    enter = 'for file; do echo 0 >"$file"; done; exec "$0" -c "$PROGRAM"'
    return subprocess.Popen(["sh", "-c", enter, sys.executable, *map(str, group.entrances)],
                            env={**os.environ, "PROGRAM": program}, stdin=subprocess.PIPE,
                            stdout=subprocess.PIPE, text=True, start_new_session=True)


def end(group):
    for pid in group.entrances[0].read_text().split():
        os.kill(int(pid), 9)


def test_a_lab_that_takes_too_much_memory_ends_alone(groups):
    needs(groups, "memory")
    greedy, modest = (groups.lab(name, MEMORY_LIMIT, TASK_LIMIT) for name in ("greedy", "modest"))
    started = [start(lab, "print(len(bytearray(%d)))" % size) for lab, size in ((greedy, MEMORY), (modest, 1000))]
    assert [process.communicate(timeout=60.0)[0] for process in started] == ["", "1000\n"]
    assert (greedy.has_run_out(), modest.has_run_out()) == (True, False)
    greedy.remove()
    assert not groups.lab("greedy", MEMORY_LIMIT, TASK_LIMIT).has_run_out()


def test_buffers_of_sockets_are_memory_of_a_lab(groups):
    needs(groups, "memory")
    lab = groups.lab("talkative", GB, TASK_LIMIT)
    process = start(lab, FILL_SOCKETS)
    held = int(process.stdout.readline())
    used = lab.memory_bytes()
    process.communicate(timeout=60.0)
    assert held > 40 << 20 and used > held


def test_a_lab_that_computes_in_a_hundred_processes_takes_its_share_alone(groups):
    needs(groups, "cpu")
    needs(groups, "pids")
    labs = [groups.lab(name, GB, TASK_LIMIT) for name in ("many", "few")]
    processors = len(os.sched_getaffinity(0))
    started = [start(labs[0], SPIN % TASKS), start(labs[1], SPIN % processors)]
    try:
        wait_until(lambda: all(map(used_s, labs)), "both labs compute", 60.0)
        before = list(map(used_s, labs))
        wait_until(lambda: sum(map(used_s, labs)) - sum(before) >= 2.0, "two seconds of processor time", 60.0)
        many, few = (after - earlier for after, earlier in zip(map(used_s, labs), before, strict=True))
    finally:
        for lab in labs:
            end(lab)
        for process in started:
            process.communicate(timeout=60.0)
    assert 0.6 < few / many < 1.7


def used_s(lab):
    """Processor time of the living processes of a group [s]; in nanoseconds in the file, in stat in hundredths."""
    found_ns = 0
    for pid in lab.entrances[0].read_text().split():
        try:
            found_ns += int(Path("/proc/%s/schedstat" % pid).read_text().split()[0])
        except OSError:
            continue
    return 1e-9 * found_ns


def test_a_lab_that_starts_processes_without_end_is_stopped(groups):
    needs(groups, "pids")
    lab = groups.lab("many", GB, 20)
    program = ("import os, sys\ncount = 0\ntry:\n    while count < 100:\n        if os.fork() == 0:\n"
               "            sys.stdin.read()\n            os._exit(0)\n        count += 1\n"
               "except BlockingIOError:\n    print(count, flush=True)\n")
    assert start(lab, program).communicate(timeout=60.0)[0] == "19\n"
    lab.remove()


def test_what_a_killed_supervisor_left_is_removed(groups):
    if not groups.folders:
        pytest.skip(str(groups))
    groups.lab("anna", GB, 20)
    groups.remove()
    again = found("lab-class-test-%d-2" % os.getpid(), 2)
    again.lab("anna", GB, 20)
    # As after its death: nobody is in the front door's group.
    for home in again._homes:
        control_groups._leave(home)
    for folder in again.folders:
        remove_left_over(folder)
        assert not Path(folder).exists()
