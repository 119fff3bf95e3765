# SPDX-License-Identifier: BSD-3-Clause
"""The supervisor's measurements of folders that students write to; its loops outlive any error."""
import asyncio
import os
import tempfile
import traceback
from pathlib import Path
from types import SimpleNamespace

import pytest

from lab_class import disk
from lab_class.disk import DiskQuota, nameless_bytes, occupied, remove
from lab_class.labs import ClassLabState, Labs
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
    assert occupied(deep_folder)[0] > 2**20
    remove(deep_folder)
    assert not deep_folder.exists()


def test_empty_files_count(tmp_path):
    before = occupied(tmp_path)
    for number in range(1000):
        (tmp_path / str(number)).touch()
    after = occupied(tmp_path)
    assert after[0] >= before[0] + 256 * 1000 and after[1] == before[1] + 1000


def test_files_behind_links_do_not_count(tmp_path):
    (tmp_path / "home").mkdir()
    (tmp_path / "large").write_bytes(b"x" * 2**20)
    (tmp_path / "home/link").symlink_to(tmp_path / "large")
    assert occupied(tmp_path / "home")[0] < 2**20


def test_a_folder_that_is_gone_is_an_error_that_names_it(tmp_path):
    with pytest.raises(OSError, match="gone"):
        occupied(tmp_path / "gone")


def _as_a_student(function):
    """Whether a function of a folder returns true for a user whom permissions bind; the superuser is bound by none."""
    pid = os.fork()
    if pid == 0:
        try:
            if os.geteuid() == 0:
                os.setgid(_NOBODY)
                os.setuid(_NOBODY)
            with tempfile.TemporaryDirectory(dir="/tmp") as folder:
                done = function(Path(folder))
            os._exit(0 if done else 1)
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
    assert _as_a_student(lambda folder: occupied(_locked(folder))[0] > 2**20)


def test_a_locked_folder_is_removed():
    def gone(folder):
        home = _locked(folder)
        remove(home)
        return not home.exists()

    assert _as_a_student(gone)


def test_a_folder_that_cannot_be_measured_ends_its_lab_and_the_others_are_looked_at(tmp_path, monkeypatch):
    monkeypatch.setattr(disk, "occupied", _either)
    labs = Labs(["anna", "ben", "cleo"], 3, None)
    watcher = SimpleNamespace(labs=labs, done=[], _quota=DiskQuota(2**20, tmp_path))
    for name in ("anna", "ben", "cleo"):
        (tmp_path / name).mkdir()
    watcher._processes = dict.fromkeys(["anna", "ben", "cleo"], SimpleNamespace(family=set))
    watcher._store = SimpleNamespace(lab=lambda name: tmp_path / name)
    watcher._now, watcher._do = lambda: 0.0, watcher.done.append
    watcher._exceed = lambda name, why: Supervisor._exceed(watcher, name, why)
    for lab in labs:
        lab.state = ClassLabState.RUNNING
    asyncio.run(Supervisor._look_at_disk(watcher))
    assert [lab.state for lab in labs] == [ClassLabState.FAILED, ClassLabState.RUNNING,
                                           ClassLabState.FAILED] and len(watcher.done) == 2
    assert labs["anna"].reason == "its files could not be measured: du cannot read anna"
    assert labs["cleo"].reason.startswith("its files have 0.00 GB, and may have 0.00 GB")


def _either(folder):
    if folder.name == "anna":
        raise OSError("du cannot read anna")
    return 2**21 if folder.name == "cleo" else 1, 1


def test_removed_files_that_are_open_count_once(tmp_path):
    device = tmp_path.stat().st_dev
    others = nameless_bytes([os.getpid()], device)  # pytest keeps what the tests have printed in such files
    with open(tmp_path / "hidden", "wb") as stream:
        stream.write(b"x" * 2**20)
        stream.flush()
        (tmp_path / "hidden").unlink()
        second = os.dup(stream.fileno())
        assert occupied(tmp_path)[0] < 2**20
        assert 2**20 <= nameless_bytes([os.getpid()], device) - others < 2**21
        assert nameless_bytes([os.getpid()], -1) == 0
        os.close(second)


@pytest.fixture
def free(monkeypatch):
    """The free space of the disk, which a test can set."""
    found = SimpleNamespace(f_bavail=10000, f_frsize=2**20, f_favail=0, f_files=0)
    monkeypatch.setattr(os, "statvfs", lambda folder: found)
    return found


def test_files_are_measured_as_soon_as_the_disk_fills(free, tmp_path):
    quota = DiskQuota(1000 * 2**20, tmp_path)
    assert quota.is_due(0.0)
    quota.looked(0.0, 1.0)
    free.f_bavail -= 10
    assert not quota.is_due(10.0)
    free.f_bavail -= 100
    assert quota.is_due(2.0)
    # As long as the last time took, it waits.
    assert not quota.is_due(1.5)
    quota.looked(2.0, 3.0)
    assert not quota.is_due(10.0) and quota.is_due(33.0)


def test_many_empty_files_fill_the_disk_too(free, tmp_path):
    free.f_favail = 10**7
    quota = DiskQuota(2**30, tmp_path)
    quota.looked(0.0, 0.0)
    free.f_favail -= disk.ENTRIES // 20
    assert not quota.is_due(1.0)
    free.f_favail -= disk.ENTRIES // 20
    assert quota.is_due(1.0)


def test_a_lab_with_too_many_empty_files_is_ended_and_may_run_again_to_delete_some(free, tmp_path):
    quota = DiskQuota(2**30, tmp_path, entries=100)
    for number in range(100):
        (tmp_path / str(number)).touch()
    assert quota.measured("anna", tmp_path, ()).startswith("it has 101 files and folders, and may have 100. Some")
    assert quota.measured("anna", tmp_path, ()) == ""
    for number in range(7):
        (tmp_path / ("more-%d" % number)).touch()
    assert quota.measured("anna", tmp_path, ())


def test_a_lab_with_too_many_files_may_run_again_to_delete_some(free, tmp_path, monkeypatch):
    used = {"files": 2000}
    monkeypatch.setattr(disk, "occupied", lambda folder: (used["files"], 1))
    quota = DiskQuota(1000, tmp_path)
    assert "may have" in quota.measured("anna", tmp_path, ())
    assert quota.used == {"anna": 2000}
    assert quota.measured("anna", tmp_path, ()) == ""
    used["files"] = 2100
    assert quota.measured("anna", tmp_path, ())
    used["files"] = 900
    assert quota.measured("anna", tmp_path, ()) == ""
    used["files"] = 1100
    assert quota.measured("anna", tmp_path, ()), "what it had once is forgotten"


def test_on_a_disk_that_is_nearly_full_the_lab_that_writes_ends(free, tmp_path, monkeypatch):
    written = {"writes": 0, "idle": 0}
    monkeypatch.setattr(disk, "occupied", lambda folder: (0, 1))
    monkeypatch.setattr(disk, "nameless_bytes", lambda pids, device: 0)
    monkeypatch.setattr(disk, "written_bytes", lambda name: written[name])
    limit = 100 * 2**20
    quota = DiskQuota(limit, tmp_path)
    written["writes"] = written["idle"] = 2 * limit
    assert [quota.measured(name, tmp_path, name) for name in written] == ["", ""]
    free.f_bavail, written["writes"] = 150, 3 * limit
    assert [bool(quota.measured(name, tmp_path, name)) for name in written] == [True, False]


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
