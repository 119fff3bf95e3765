# SPDX-License-Identifier: BSD-3-Clause
"""Files in memory and sockets of a lab, which no process's memory shows."""
import asyncio
import os
import socket
import subprocess
import sys
from types import SimpleNamespace

import pytest

from lab_class import scratch
from lab_class.lab_process import LabProcess
from lab_class.labs import ClassLabState, Labs
from lab_class.scratch import Scratch, too_many_sockets
from lab_class.supervisor import Supervisor
from processes import isolation, usage
from processes.family import children_of

EMPTY, LARGE_BYTES = 300, 8 << 20
# Fills folders in memory, then waits for the end of its standard input.
PROGRAM = """
import sys
for number in range(%d):
    open("/tmp/%%d" %% number, "w").close()
with open("/dev/shm/large", "wb") as stream:
    stream.write(bytes(%d))
print("done", flush=True)
sys.stdin.read()
""" % (EMPTY, LARGE_BYTES)


@pytest.fixture
def family():
    """A function: the processes of a sandbox that has made files in memory."""
    if isolation.problem():
        pytest.skip(isolation.problem())
    process = subprocess.Popen([*isolation.command(dict(os.environ)), sys.executable, "-c", PROGRAM],
                               stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "done\n"
    yield lambda: children_of([process.pid]) if process.poll() is None else set()
    process.communicate(timeout=60.0)


def test_files_in_memory_are_counted_and_have_a_size(family):
    entries, size = usage.files_in_memory(usage.root_of(family()))
    assert EMPTY < entries < EMPTY + 20
    assert LARGE_BYTES + EMPTY * usage.ENTRY_BYTES <= size < LARGE_BYTES + 2 * EMPTY * usage.ENTRY_BYTES + 2**20


def test_a_lab_with_too_many_files_in_memory_is_told_so_and_others_are_not(family, monkeypatch):
    looked = Scratch()
    assert looked.exceeded("anna", family) == "" and looked.bytes("anna", family) > LARGE_BYTES
    monkeypatch.setattr(scratch, "ENTRIES", EMPTY)
    why = looked.exceeded("anna", family)
    assert why.startswith("it has made 30") and why.endswith("and may have 300")
    looked.ended("anna")
    # The same name may be another lab's sandbox by now, or one that has not begun.
    assert looked.exceeded("anna", set) == "" and looked.exceeded("ben", lambda: [os.getpid()]) == ""


def test_folders_whose_process_has_ended_are_looked_for_again(family, monkeypatch):
    looked, roots = Scratch(), ["/proc/0/root", usage.root_of(family())]
    monkeypatch.setattr(usage, "root_of", lambda pids: roots.pop(0))
    assert looked.bytes("anna", set) == 0
    assert looked.bytes("anna", set) > LARGE_BYTES


def test_files_in_memory_count_as_memory_once(monkeypatch):
    process = SimpleNamespace(family=lambda: [1, 2])
    monkeypatch.setattr("lab_class.lab_process._share_of_memory", lambda pid: (100, 10))
    assert LabProcess.memory_bytes(process) == 220
    assert LabProcess.memory_bytes(process, 15) == 220
    assert LabProcess.memory_bytes(process, 500) == 700


def test_sockets_are_counted_once(monkeypatch):
    before = usage.sockets([os.getpid()])
    with socket.socket() as one, socket.socket(), socket.socket(fileno=os.dup(one.fileno())):
        assert usage.sockets([os.getpid()]) == before + 2
        monkeypatch.setattr(scratch, "SOCKETS", before + 1)
        assert too_many_sockets([os.getpid()]) == "it has opened %d sockets, and may have %d" % (before + 2, before + 1)
    assert too_many_sockets([os.getpid()]) == ""


def watcher(**values):
    """A supervisor for its watches, with one lab that runs."""
    found = SimpleNamespace(labs=Labs(["anna"], 1, None), done=[], _now=lambda: 0.0, **values)
    found.labs["anna"].state = ClassLabState.RUNNING
    found._do = found.done.append
    found._processes = {"anna": SimpleNamespace(family=set, memory_bytes=lambda files: 100 + files)}
    found._exceed = lambda name, why: Supervisor._exceed(found, name, why)
    return found


def test_the_supervisor_ends_a_lab_for_files_in_memory():
    found = watcher(_scratch=SimpleNamespace(exceeded=lambda name, family: "it has made 7 files"))
    asyncio.run(Supervisor._look_at_scratch(found))
    assert found.labs["anna"].state is ClassLabState.FAILED and found.labs["anna"].reason == "it has made 7 files"


def test_without_a_control_group_files_in_memory_and_sockets_count(monkeypatch):
    monkeypatch.setattr("lab_class.supervisor.too_many_sockets", lambda pids: "it has opened 9 sockets")
    found = watcher(_scratch=SimpleNamespace(bytes=lambda name, family: 11), _memory={},
                    _record=SimpleNamespace(options=SimpleNamespace(memory_bytes=1000)),
                    _groups={"anna": SimpleNamespace(memory_bytes=lambda: None, has_run_out=lambda: False)})
    found._without_group = lambda name, process: Supervisor._without_group(found, name, process)
    asyncio.run(Supervisor._look_at_memory(found))
    assert found._memory == {"anna": 111} and found.labs["anna"].reason == "it has opened 9 sockets"
