# SPDX-License-Identifier: BSD-3-Clause
"""What the supervisor measures in folders that students write to, and that its loops outlive any error."""
import asyncio
import os
import tempfile
import traceback
from pathlib import Path
from types import SimpleNamespace

import pytest

from lab_class import supervisor
from lab_class.lab_process import disk_bytes, remove
from lab_class.labs import Labs, State
from lab_class.store import Options
from lab_class.supervisor import Supervisor, _end_of

_NOBODY = 65534

DEPTH = 3000


@pytest.fixture
def deep_folder(tmp_path):
    """Deeper than Python's recursion and the longest path; a file of 1 MB is at the bottom."""
    top = tmp_path / "home"
    top.mkdir()
    here = os.open(top, os.O_RDONLY)
    for _ in range(DEPTH):
        os.mkdir("d", dir_fd=here)
        below = os.open("d", os.O_RDONLY, dir_fd=here)
        os.close(here)
        here = below
    with open(os.open("large", os.O_WRONLY | os.O_CREAT, dir_fd=here), "wb") as stream:
        stream.write(b"x" * 2**20)
    os.close(here)
    yield top
    remove(top)


def test_a_file_in_a_very_deep_folder_counts_and_can_be_removed(deep_folder):
    assert disk_bytes(deep_folder) > 2**20
    remove(deep_folder)
    assert not deep_folder.exists()


def test_empty_files_count(tmp_path):
    before = disk_bytes(tmp_path)
    for number in range(1000):
        (tmp_path / str(number)).touch()
    assert disk_bytes(tmp_path) >= before + 256 * 1000


def test_files_behind_links_do_not_count(tmp_path):
    (tmp_path / "home").mkdir()
    (tmp_path / "large").write_bytes(b"x" * 2**20)
    (tmp_path / "home/link").symlink_to(tmp_path / "large")
    assert disk_bytes(tmp_path / "home") < 2**20


def test_a_folder_that_is_gone_is_an_error_that_names_it(tmp_path):
    with pytest.raises(OSError, match="gone"):
        disk_bytes(tmp_path / "gone")


def _as_a_student(function):
    """Whether a function of a folder returns true for a user whom permissions bind; the superuser is bound by none."""
    pid = os.fork()
    if pid == 0:
        try:
            if os.geteuid() == 0:
                os.setgid(_NOBODY)
                os.setuid(_NOBODY)
            with tempfile.TemporaryDirectory(dir="/tmp") as folder:
                os._exit(0 if function(Path(folder)) else 1)
        except BaseException:
            traceback.print_exc()
            os._exit(2)
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == 0


def _locked(folder):
    home = folder / "home"
    (home / "locked").mkdir(parents=True)
    (home / "locked/large").write_bytes(b"x" * 2**20)
    (home / "locked").chmod(0)
    return home


def test_files_in_a_locked_folder_count():
    assert _as_a_student(lambda folder: disk_bytes(_locked(folder)) > 2**20)


def test_a_locked_folder_is_removed():
    def gone(folder):
        home = _locked(folder)
        remove(home)
        return not home.exists()

    assert _as_a_student(gone)


def test_a_folder_that_cannot_be_measured_ends_its_lab_and_the_others_are_looked_at(tmp_path, monkeypatch):
    monkeypatch.setattr(supervisor, "disk_bytes", _either)
    labs = Labs(["anna", "ben", "cleo"], 3, None)
    watcher = SimpleNamespace(labs=labs, done=[])
    watcher._record = SimpleNamespace(options=Options(disk_bytes=2**20))
    watcher._processes, watcher._store = dict.fromkeys(["anna", "ben", "cleo"]), SimpleNamespace(lab=str)
    watcher._now, watcher._do = lambda: 0.0, watcher.done.append
    for lab in labs:
        lab.state = State.RUNNING
    asyncio.run(Supervisor._look_at_disk(watcher))
    assert [lab.state for lab in labs] == [State.FAILED, State.RUNNING, State.FAILED] and len(watcher.done) == 2
    assert labs["anna"].reason == "its files could not be measured: du cannot read anna"
    assert labs["cleo"].reason.startswith("its files have 0.0 GB")


def _either(name):
    if name == "anna":
        raise OSError("du cannot read anna")
    return 2**21 if name == "cleo" else 1


def test_a_loop_outlives_an_error():
    calls = []

    async def watch():
        calls.append(None)
        if len(calls) == 1:
            raise RecursionError("a lab's folder")
        if len(calls) == 3:
            raise asyncio.CancelledError

    with pytest.raises(asyncio.CancelledError):
        asyncio.run(Supervisor._every(0.0, watch))
    assert len(calls) == 3


def test_of_a_large_output_only_the_end_is_read(tmp_path):
    path = tmp_path / "output.txt"
    with open(path, "wb") as stream:
        stream.truncate(2**33)
        stream.seek(0, os.SEEK_END)
        stream.write(b"\nthe lab ended: roslaunch failed\n")
    assert _end_of(path).splitlines()[-1] == "the lab ended: roslaunch failed"
    path.write_bytes(b"short")
    assert _end_of(path) == "short"
