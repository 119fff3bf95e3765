# SPDX-License-Identifier: BSD-3-Clause
"""The files that a sandbox shows: a workspace inside of a home, copies of compiled functions."""
import errno
import os
import shutil
import subprocess

import pytest

from processes import isolation


@pytest.fixture
def workspace(tmp_path, monkeypatch):
    """A workspace in which numba has compiled three functions."""
    cache = tmp_path / "workspace/src/package/__pycache__"
    cache.mkdir(parents=True)
    for number in range(3):
        (cache / ("function-%d.nbi" % number)).write_bytes(b"x")
    monkeypatch.setattr(isolation, "workspaces", lambda environment: [str(tmp_path / "workspace")])
    return cache


def test_a_sandbox_gets_copies(workspace, tmp_path):
    (copy, place, writable), = isolation.caches({}, tmp_path / "copies")
    assert place == workspace and writable and sorted(os.listdir(copy)) == sorted(os.listdir(workspace))


def test_a_full_disk_is_one_short_sentence(workspace, tmp_path, monkeypatch):
    def full(source, target, **_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), source, None, target)

    monkeypatch.setattr(shutil.copytree, "__defaults__", (False, None, full, False, False))
    with pytest.raises(OSError, match="cannot be copied to") as raised:
        isolation.caches({}, tmp_path / "copies")
    assert str(raised.value).endswith(os.strerror(errno.ENOSPC)) and len(str(raised.value)) < 400


@pytest.mark.skipif(bool(isolation.problem()), reason=isolation.problem() or "no problem")
def test_a_workspace_in_the_folder_that_a_home_stands_for_is_seen_and_so_is_the_home(tmp_path, monkeypatch):
    seen, root = tmp_path / "home", tmp_path / "home/ws"
    root.mkdir(parents=True)
    (root / "file").write_text("workspace")
    home = tmp_path / "kept"
    home.mkdir()
    (home / "own").write_text("home")
    monkeypatch.setattr(isolation, "workspaces", lambda environment: [str(root)])
    shown = subprocess.run([*isolation.command({}, [(home, seen, True)]), "cat", str(root / "file"), str(seen / "own")],
                           capture_output=True, text=True, timeout=60.0)
    assert (shown.stdout, shown.stderr) == ("workspacehome", "")
