# SPDX-License-Identifier: BSD-3-Clause
"""Room on a disk, and the folder that stands in for a full one."""
import os
import tempfile

import pytest

from bullet_sim.room import spare_folder, try_room


def test_a_disk_without_room_says_so(tmp_path):
    free = os.statvfs(tmp_path)
    with pytest.raises(OSError):
        try_room(tmp_path, 2 * free.f_blocks * free.f_frsize)
    assert list(tmp_path.iterdir()) == []


def test_the_spare_folder_is_one_for_all_processes_of_a_user_and_nobody_elses(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    folder = spare_folder("things")
    assert folder == spare_folder("things") == tmp_path / ("things_%d" % os.getuid())
    folder.chmod(0o777)
    with pytest.raises(PermissionError, match="not a folder of this user alone"):
        spare_folder("things")


def test_a_link_is_no_spare_folder(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    (tmp_path / ("things_%d" % os.getuid())).symlink_to(tmp_path)
    with pytest.raises(PermissionError):
        spare_folder("things")
