# SPDX-License-Identifier: BSD-3-Clause
"""Copies of compiled functions for sandboxes."""
import errno
import os
import shutil

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
