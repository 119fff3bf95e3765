# SPDX-License-Identifier: BSD-3-Clause
"""The temporary folder of checks and gradings: its end, and those that killed ones have left."""
import os
import signal
import subprocess
import sys
import tempfile

import pytest

from processes.work_folder import claimed_folder, work_folder

HOLDS = """import os, sys
from processes.work_folder import work_folder
with work_folder("lab-a-") as folder:
    (folder / "large").write_text("x")
    print(folder, flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def top(monkeypatch, tmp_path):
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr(tempfile, "tempdir", None)
    return tmp_path


def test_it_is_where_temporary_files_go_and_ends_with_its_work(top):
    with pytest.raises(ZeroDivisionError), work_folder("lab-a-") as folder:
        assert folder.parent == top and folder.name.startswith("lab-a-")
        assert tempfile.gettempdir() == os.environ["TMPDIR"] == str(folder)
        raise ZeroDivisionError
    assert os.listdir(top) == [] and tempfile.gettempdir() == os.environ["TMPDIR"] == str(top)


def test_those_of_killed_processes_go_with_the_next_start_and_others_stay(top):
    (top / "lab-b-1").mkdir()
    (top / "lab-a-link").symlink_to("lab-b-1")
    holders = [subprocess.Popen([sys.executable, "-c", HOLDS], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                text=True) for _ in range(2)]
    killed, running = (os.path.basename(holder.stdout.readline().strip()) for holder in holders)
    holders[0].send_signal(signal.SIGKILL)
    holders[0].communicate()
    left = []
    try:
        with claimed_folder("lab-a-", lambda one: left.append((one.name, one.is_dir()))) as folder:
            assert left == [(killed, True)]
            assert sorted(os.listdir(top)) == sorted([folder.name, running, "lab-b-1", "lab-a-link"])
    finally:
        holders[1].communicate()
    assert sorted(os.listdir(top)) == ["lab-a-link", "lab-b-1"] and killed != running
