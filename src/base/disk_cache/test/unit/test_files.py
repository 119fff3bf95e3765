# SPDX-License-Identifier: BSD-3-Clause
"""Room on a disk, and the folder that stands in for a full one."""
import os
import tempfile

import pytest

from disk_cache.files import draft_of, remove_drafts, replace_text, spare_folder, try_room


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


def test_a_draft_takes_the_place_when_it_is_complete(tmp_path):
    target = tmp_path / "thing.txt"
    target.symlink_to("elsewhere")
    with draft_of(target) as draft:
        draft.write_text("whole")
        assert not target.exists() and draft.suffix == ".txt"
    assert target.read_text() == "whole" and not target.is_symlink()
    with pytest.raises(KeyError), draft_of(target) as draft:
        draft.write_text("half")
        raise KeyError
    assert (target.read_text(), os.listdir(tmp_path)) == ("whole", ["thing.txt"])
    with draft_of(tmp_path / "folder") as draft:
        draft.mkdir()
    assert (tmp_path / "folder").is_dir()


def test_only_the_user_reads_a_replaced_text(tmp_path):
    replace_text(tmp_path / "one", "text")
    assert (tmp_path / "one").read_text() == "text" and (tmp_path / "one").stat().st_mode & 0o777 == 0o600


def test_old_drafts_are_removed_and_nothing_else(tmp_path):
    (tmp_path / ".draft-link").symlink_to(tmp_path)
    for name, age_s in ((".draft-old", 100.0), (".draft-new", 0.0), (".other", 100.0)):
        (tmp_path / name).mkdir()
        then = (tmp_path / name).stat().st_mtime - age_s
        os.utime(tmp_path / name, (then, then))
    remove_drafts(tmp_path, 50.0)
    assert sorted(os.listdir(tmp_path)) == [".draft-link", ".draft-new", ".other"]
    remove_drafts(tmp_path)
    assert sorted(os.listdir(tmp_path)) == [".draft-link", ".other"]
